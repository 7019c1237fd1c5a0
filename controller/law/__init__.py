"""The force law, its gains from the tissue model, and its reference."""
