"""The version of flownav."""

__version__ = "0.1.0"
