"""Jobs: what takes longer than an answer, each with state, progress, time left, log, typed result and files."""
