"""A client of the protocol is welcomed by the bridge."""

import json

from websockets.sync.client import connect
from websockets.typing import Subprotocol

from api.http.streams.bridge import bridged
from mock_devices.testing.commands import free_port


def exchange() -> None:
    """Its name, and that it has channels."""
    port = free_port()
    with bridged(port, "extra"), connect(f"ws://127.0.0.1:{port}", subprotocols=[Subprotocol("foxglove.sdk.v1")]) as it:
        said = [json.loads(it.recv(10)) for _ in range(2)]
    assert said[0]["name"] == "tissue-rig" and said[1]["op"] == "advertise"
