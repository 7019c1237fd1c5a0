"""Input events of Linux: foot switches, buttons and keypads."""
