"""The way back after a crash or a fault: how things stand, consent, acts."""
