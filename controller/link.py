"""Messages between the loop's process and its supervisor: JSON over a packet socket that never blocks the loop."""

import json
import socket
from collections import deque
from typing import Any

Message = dict[str, Any]
LARGEST_BYTES = 150_000


class Link:
    """One end. Status may be lost when the other end is slow; everything sent by ``send`` is kept until it goes out."""

    def __init__(self, end: socket.socket) -> None:
        self._socket = end
        self._socket.setblocking(False)
        self._outbox: deque[bytes] = deque()
        self.lost = False

    def send(self, message: Message) -> None:
        """Queues ``message`` and sends what the other end takes now."""
        self._outbox.append(json.dumps(message).encode())
        self.flush()

    def send_status(self, message: Message) -> None:
        """Sends ``message`` if there is room now, else drops it: the next one is newer."""
        if not self._outbox:
            self._outbox.append(json.dumps(message).encode())
            if not self.flush():
                self._outbox.clear()

    def flush(self) -> bool:
        """Sends what is queued; False where the other end is slow or gone."""
        while self._outbox:
            try:
                self._socket.send(self._outbox[0])
            except BlockingIOError:
                return False
            except OSError:
                self.lost = True
                self._outbox.clear()
                return False
            self._outbox.popleft()
        return True

    def receive(self) -> Message | None:
        """The next message, or None; sets ``lost`` where the other end is gone."""
        try:
            packet = self._socket.recv(LARGEST_BYTES)
        except BlockingIOError:
            return None
        except OSError:
            packet = b""
        if not packet:
            self.lost = True
            return None
        message: Message = json.loads(packet)
        return message

    def fileno(self) -> int:
        """Descriptor to wait on."""
        return self._socket.fileno()

    def close(self) -> None:
        """Closes this end."""
        self._socket.close()


def pair() -> tuple[socket.socket, socket.socket]:
    """Two connected ends, with room for a large program."""
    ends = socket.socketpair(socket.AF_UNIX, socket.SOCK_SEQPACKET)
    for end in ends:
        end.setsockopt(socket.SOL_SOCKET, socket.SO_SNDBUF, 4 * LARGEST_BYTES)
    return ends
