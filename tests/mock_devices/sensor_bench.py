"""A force mock on a wire in memory."""

from typing import Generic, TypeVar

from mock_devices.interfaces import ProtocolMock
from mock_devices.testing.wire import MemoryWire

AnyMock = TypeVar("AnyMock", bound=ProtocolMock)


class SensorBench(Generic[AnyMock]):
    """A mock on a wire in memory, with the clock in the test's hand."""

    def __init__(self, mock: AnyMock, wire: MemoryWire, now_ns: int) -> None:
        self.mock, self.wire, self.now_ns = mock, wire, now_ns

    def say(self, data: bytes) -> bytes:
        """What the mock answers at once."""
        self.wire.said += data
        self.mock.receive(self.now_ns)
        return self.wire.take()

    def wait(self, duration_ns: int) -> bytes:
        """What the mock sends in the next while."""
        end_ns = self.now_ns + duration_ns
        while self.mock.due_ns <= end_ns:
            self.mock.tick(self.mock.due_ns)
        self.now_ns = end_ns
        return self.wire.take()
