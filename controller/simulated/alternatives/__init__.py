"""What the force law is compared with, tuned at its own margins; no bench runs any of it."""
