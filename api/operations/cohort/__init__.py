"""Many sessions at once: each worked on by itself, on cores or computers, and what they share."""
