"""The bench on a virtual clock, the loop's own functions compiled."""
