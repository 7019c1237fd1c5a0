"""Sessions and recordings: one MCAP file a recording, every sample with its sequence number."""
