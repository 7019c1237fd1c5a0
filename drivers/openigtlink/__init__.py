"""OpenIGTLink trackers: any program that sends TRANSFORM or TDATA messages over TCP."""
