"""Mock of the Bota SensONE."""
