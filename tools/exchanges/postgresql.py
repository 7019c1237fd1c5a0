"""The catalogue asks a server of PostgreSQL that is just starting up, which is what it then says."""

import socket
import struct
import threading
from pathlib import Path

from api.catalogue.database import CatalogueUnavailable, Database, address

REFUSAL = b"SFATAL\0VFATAL\0C57P03\0Mthe database system is starting up\0\0"


def _refuse(server: socket.socket) -> None:
    """The start of the protocol, version 3: no encryption, then a refusal."""
    client, _ = server.accept()
    with client:
        size, code = struct.unpack("!ii", client.recv(8))
        if (size, code) == (8, 80_877_103):
            client.sendall(b"N")
            client.recv(4096)
        client.sendall(b"E" + struct.pack("!i", len(REFUSAL) + 4) + REFUSAL)


def exchange() -> None:
    """A refusal, understood."""
    with socket.create_server(("127.0.0.1", 0)) as server:
        threading.Thread(target=_refuse, args=(server,), daemon=True).start()
        url = f"postgresql://nobody@127.0.0.1:{server.getsockname()[1]}/none?sslmode=prefer&gssencmode=disable"
        try:
            Database(address(url, Path("unused")), Path()).prepare()
        except CatalogueUnavailable as error:
            assert "starting up" in str(error), error
        else:
            raise AssertionError("the refusal was not heard")
