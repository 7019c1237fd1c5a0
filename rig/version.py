"""Which software made a file."""

__version__ = "0.1.0"
SOFTWARE = f"tissue-rig {__version__}"
