"""Bota SensONE / Rokubi, serial version: a six-axis force sensor that streams 100 to 1004 frames a second."""
