"""From SymPy models of mechanical systems, chains of n links among them, to C++ kernels."""

__version__ = "0.1.0"
