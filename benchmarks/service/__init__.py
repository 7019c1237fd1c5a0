"""How much the service can be asked while the loop runs in contact."""
