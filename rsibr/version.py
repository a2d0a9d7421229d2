"""Version of the package, also of everything that it writes."""

__version__ = "0.2.0"
