"""bushfit: fit and question the frequency- and amplitude-dependent stiffness of rubber bushings."""

__version__ = "0.1.0"
