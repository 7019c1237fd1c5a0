"""Recordings and results as pictures, tables and one self-contained HTML page."""
