"""Simulated microcontroller with StandardFirmata, and the glove on its inputs."""
