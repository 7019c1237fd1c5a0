"""In place of a wire, for a mock whose client needs none."""


class NoWire:
    """Nothing comes and nothing goes."""

    endpoint = ""

    def filenos(self) -> list[int]:
        """None."""
        return []

    def read(self) -> bytes:
        """Nothing."""
        return b""

    def write(self, data: bytes) -> None:
        """Nobody hears it."""

    def close(self) -> None:
        """There is nothing to cut."""
