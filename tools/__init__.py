"""What a developer or CI runs on the repository itself: checks, and the making of the documentation."""
