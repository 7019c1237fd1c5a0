"""What stops motion: the priority table, its checks, and what they look at."""
