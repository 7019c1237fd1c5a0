"""The three configuration files: wiring, protocol, calibration."""
