"""From a SymPy model of one link to C++ kernels for chains of n links."""

__version__ = "1.0.0"
