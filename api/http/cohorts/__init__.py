"""Cohorts over HTTP: jobs on many sessions at once."""
