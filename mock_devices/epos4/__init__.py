"""Mock of the maxon EPOS4."""
