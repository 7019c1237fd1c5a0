"""CAN behind a Lawicel (SLCAN) adapter: a pure line codec and the opening of the adapter through python-can."""
