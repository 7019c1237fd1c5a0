"""CANopen as a mock node speaks it."""
