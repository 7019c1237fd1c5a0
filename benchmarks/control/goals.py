"""What the force law promises against the tuned constant."""

# A headline that is missed by chance of one subject would be missed by half; these are the promises themselves.
GOALS = {"0.5": 3.0, "1": 3.0, "2": 2.0, "5": 1.0, "10": 0.7}
LOW_JUMPS, JUMPS, PEAK, DEG, DB = 3.0, 1.8, 1.05, 45.0, 6.0
ROUNDED = 0.05  # a margin that is searched to three digits may be this much below
