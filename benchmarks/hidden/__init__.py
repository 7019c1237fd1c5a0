"""Hidden causes: benches that are drawn with physics of their own, for diagnosis to be tried on."""
