"""Model criticism: what the simulation gets wrong, the cause by name, the extended model, and the measured gain."""
