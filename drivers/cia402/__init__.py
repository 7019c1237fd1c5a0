"""Any CiA 402 servo drive: its objects and units from its electronic data sheet, the session that of the EPOS4."""
