"""Robotiq FT 300 and FT 300-S: six-axis force sensors with Modbus RTU registers and a stream of 100 frames a second."""
