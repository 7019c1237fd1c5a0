"""What people touch: the command line and the HTTP service with its page."""
