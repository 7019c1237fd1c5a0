"""The bench's physics in plain floats: one fixed step, and operators for the effects that can be hidden in it."""

# An eighth of the fastest time constant (a velocity gain of 480/s), four to a set-point of 1 kHz; of a core it takes
# 1.2 % at 3 us a step.
STEP_NS = 250_000
STEP_S = STEP_NS * 1e-9
