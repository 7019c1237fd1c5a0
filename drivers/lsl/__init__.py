"""Lab Streaming Layer: streams of other programs, with their clocks."""
