"""Load-cell transmitters of the LAUMAS TLB and TLU family by Modbus RTU."""
