"""OptiTrack cameras by NatNet 3 and 4, as Motive streams them over UDP."""
