"""The loop's process: cyclic executive, state machine, steps, and the channel to its supervisor."""
