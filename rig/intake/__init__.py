"""Foreign data: files as any laboratory left them, read by a mapping and written as a session."""
