"""A CAN adapter on a wire (Lawicel CANUSB commands), for mocks of CAN nodes: text on one side, frames on the other.

It refuses with BEL what a real one refuses: a bit rate while the channel is open, frames while it is closed. A channel
opened at another bit rate than the bus' accepts frames, but they reach nobody. A line feed behind the carriage return
is passed over, as terminal programs send one. After Z1 each frame carries the milliseconds of the running minute.
"""

from binascii import hexlify

from drivers.can.slcan import LONGEST, CanFrame, Flags, decode_line
from mock_devices.wire import Wire

OK, BEL = b"\r", b"\a"
STAMP_MS = 60_000
FRAME_SENT = {b"t": b"z\r", b"r": b"z\r", b"T": b"Z\r", b"R": b"Z\r"}


class SlcanAdapter:
    """The adapter; ``rate`` is the code of the bus' bit rate, 8 for 1 Mbit/s. Output leaves with ``flush``.

    ``flags`` is what has been on the bus since it was last asked (F).
    """

    def __init__(self, wire: Wire, rate: bytes = b"8") -> None:
        self.wire = wire
        self.open = False
        self.refused, self.flags = 0, Flags(0)
        self._stamped = False
        self._rate = rate
        self._chosen = b""
        self._listen_only = False
        self._rest = b""
        self._out: list[bytes] = []

    def receive(self) -> list[CanFrame]:
        """Frames the client put on the bus since the last call; everything else is answered here."""
        *lines, self._rest = (self._rest + self.wire.read().replace(b"\n", b"")).split(OK)
        self._rest = self._rest[-LONGEST - 1 :]
        frames = []
        for line in lines:
            if self.open and line[:1] in FRAME_SENT and not self._listen_only and (frame := decode_line(line)):
                self._out.append(FRAME_SENT[line[:1]])
                if self._chosen == self._rate:
                    frames.append(frame)
            else:
                self._out.append(self._answer(line))
        return frames

    def send(self, can_id: int, data: bytes, now_ns: int) -> None:
        """A frame from the bus to the client."""
        if self.open and self._chosen == self._rate:
            self._out.append(b"t%03X%d%b%b\r" % (can_id, len(data), hexlify(data).upper(), self._stamp(now_ns)))

    def _stamp(self, now_ns: int) -> bytes:
        return b"%04X" % (now_ns // 1_000_000 % STAMP_MS) if self._stamped else b""

    def flush(self) -> None:
        """Hands all output to the wire in one write."""
        if self._out:
            self.wire.write(b"".join(self._out))
            self._out.clear()

    def _answer(self, line: bytes) -> bytes:
        answer = self._command(line[:1], line[1:])
        self.refused += answer == BEL
        return answer

    def _command(self, command: bytes, argument: bytes) -> bytes:
        match command:
            case b"":
                return OK
            case b"V":
                return b"V1013\r"
            case b"N":
                return b"NA123\r"
            case b"F" if self.open:
                said, self.flags = self.flags, Flags(0)
                return b"F%02X\r" % said
            case b"C" if self.open:
                self.open = False
                return OK
            case b"O" | b"L" if not self.open and self._chosen:
                self.open, self._listen_only = True, command == b"L"
                return OK
            case b"S" if not self.open and argument in (b"0", b"1", b"2", b"3", b"4", b"5", b"6", b"7", b"8"):
                self._chosen = argument
                return OK
            case b"s" if not self.open and len(argument) == 4:
                self._chosen = b"s" + argument
                return OK
            case b"Z" if not self.open and argument in (b"0", b"1"):
                self._stamped = argument == b"1"
                return OK
            case b"M" | b"m" if not self.open:
                return OK
        return BEL
