"""Firmata: microcontrollers whose firmware shows its pins to a computer."""
