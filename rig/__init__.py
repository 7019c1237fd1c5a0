"""What the bench knows: channels, configuration, recordings, tissue models, simulation and report."""

__version__ = "0.1.0"
