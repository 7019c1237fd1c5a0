"""The work of every command: functions of an `Operation` and typed parameters, whose results the edges only render."""
