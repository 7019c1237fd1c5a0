"""Stops from other computers, past the service: a process under its certificate, with a port of its own."""
