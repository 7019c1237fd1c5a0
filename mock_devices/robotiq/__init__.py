"""Mock of the Robotiq FT 300."""
