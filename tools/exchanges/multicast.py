"""A frame from one bus to another, on this computer alone."""

import os

import can

GROUP = "239.74.163.2"


def exchange() -> None:
    """Eight bytes as they were sent."""
    port = 20_000 + os.getpid() % 30_000
    with (
        can.Bus(GROUP, interface="udp_multicast", port=port, hop_limit=0) as here,
        can.Bus(GROUP, interface="udp_multicast", port=port, hop_limit=0) as there,
    ):
        here.send(can.Message(arbitration_id=0x181, data=range(8), is_extended_id=False))
        heard = there.recv(10.0)
    assert heard and (heard.arbitration_id, bytes(heard.data)) == (0x181, bytes(range(8)))
