"""What can go wrong with a mock, by name."""
