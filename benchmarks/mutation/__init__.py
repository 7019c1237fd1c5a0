"""Mutation testing of what keeps the tip from hurting: `make mutants`."""
