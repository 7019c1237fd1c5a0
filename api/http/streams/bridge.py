"""What the loop publishes, to Foxglove by its makers' own protocol: the bytes of the ring as they are.

A row is the body of a CDR message of the schema that recordings carry, so a layout made for a recording fits live too.
"""

import contextlib
import struct
from collections.abc import Iterator
from types import ModuleType

import numpy as np

from rig.channels import CDR_HEADER, STREAMS
from rig.errors import UsageError
from rig.recording.mcap_file import schema_name
from rig.recording.slots import Slots

HOST = "127.0.0.1"
# Every row begins with its number, when it was taken and when it arrived; a recording is in order of arrival.
_ARRIVAL = struct.Struct("<16xq")


class FoxgloveBridge:
    """A WebSocket server of the Foxglove protocol on this computer; what nobody has subscribed costs nothing."""

    def __init__(self, port: int, session_id: str) -> None:
        """Listens; raises UsageError where the port is taken or the extra is not installed."""
        sdk = _sdk()
        # The server does not keep it: without this the channels would be gone.
        self._context = context = sdk.Context()
        self._channels = {
            stream.id: sdk.Channel(
                stream.name,
                schema=sdk.Schema(name=schema_name(stream), encoding="ros2msg", data=stream.schema().encode()),
                message_encoding="cdr",
                context=context,
            )
            for stream in STREAMS
        }
        try:
            self._server = sdk.start_server(
                name="tissue-rig", host=HOST, port=port, context=context, session_id=session_id
            )
        except Exception as error:  # the SDK has no type of its own for this
            raise UsageError(f"--foxglove {port}: {error}; end what listens there, or give another port") from error

    def hand_on(self, slots: Slots) -> None:
        """Rows of the ring in their order."""
        wanted = [number for number, channel in self._channels.items() if channel.has_sinks()]
        for slot in slots[np.isin(slots["stream"], wanted)] if wanted else ():
            body = slot["body"][: slot["size"]].tobytes()
            (arrival_ns,) = _ARRIVAL.unpack_from(body)
            self._channels[int(slot["stream"])].log(CDR_HEADER + body, log_time=arrival_ns)

    def close(self) -> None:
        """Ends it."""
        self._server.stop()


def _sdk() -> ModuleType:
    try:
        import foxglove  # noqa: PLC0415 - an extra
    except ImportError as error:
        raise UsageError("--foxglove needs `pip install tissue-rig[foxglove]`") from error
    return foxglove


@contextlib.contextmanager
def bridged(port: int | None, session_id: str) -> Iterator[list[FoxgloveBridge]]:
    """A bridge on ``port`` until the block ends; none without a port."""
    bridges = [] if port is None else [FoxgloveBridge(port, session_id)]
    try:
        yield bridges
    finally:
        for bridge in bridges:
            bridge.close()
