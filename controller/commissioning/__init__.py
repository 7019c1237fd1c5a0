"""Commissioning: known loads and known distances against what sensor and axis say, and who may approach a person."""
