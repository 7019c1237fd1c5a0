"""Zaber devices of firmware 7 by their ASCII protocol, over a serial line or TCP."""
