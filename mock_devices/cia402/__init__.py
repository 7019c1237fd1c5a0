"""Mock of a CiA 402 drive of no maker in particular."""
