"""Mock of a CAN adapter."""
