"""The model: its stiffness, its derivatives, its steps through time, and what a fit found of it."""
