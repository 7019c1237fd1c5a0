"""The forward chain everything that predicts stands on: motion in, force and tip position out, one operator a cause."""
