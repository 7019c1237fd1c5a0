"""Bytes to samples and back, one folder a product; nothing here knows of tissue, loops or files."""
