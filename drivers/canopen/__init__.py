"""CANopen (CiA 301) as pure codecs: the SDO client, and NMT, heartbeat, emergency and SYNC messages."""
