"""A wire in memory."""


class MemoryWire:
    """A wire without a kernel: what the client says waits in ``said``, what the mock wrote stands in ``sent``."""

    def __init__(self, endpoint: str = "memory") -> None:
        self.endpoint = endpoint
        self.said = b""
        self.sent: list[bytes] = []
        self.closed = False

    def filenos(self) -> list[int]:
        return []

    def read(self) -> bytes:
        said, self.said = self.said, b""
        return said

    def write(self, data: bytes) -> None:
        self.sent.append(data)

    def close(self) -> None:
        self.closed = True

    def take(self) -> bytes:
        """What the mock wrote since the last call."""
        data = b"".join(self.sent)
        self.sent.clear()
        return data
