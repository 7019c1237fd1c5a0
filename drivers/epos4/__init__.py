"""maxon EPOS4 servo drive: object table, CiA 402 state walk, PDO codec and the session that fills the axis role."""
