"""What moves: the loop, the control law, gains, safety and experiments."""
