"""The model of a bushing: its response, its derivatives, the virtual rig, and the result of a fit with its file."""
