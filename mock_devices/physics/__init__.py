"""The bench's physics in plain floats: one fixed step, and operators for the effects that can be hidden in it."""

STEP_NS = 250_000
STEP_S = STEP_NS * 1e-9
