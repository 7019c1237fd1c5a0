"""The server side of SDO transfers (CiA 301, 7.2.4) for mocks: expedited and segmented; block transfers are refused."""

import struct
from collections.abc import Callable

from drivers.canopen.sdo import COMMAND_ABORT, TOGGLE_ABORT, encode_abort


class SdoAbort(Exception):
    """The dictionary refuses an access; ``code`` goes to the client."""

    def __init__(self, code: int) -> None:
        super().__init__(f"{code:#010x}")
        self.code = code


class SdoServer:
    """Answers one client out of ``read(index, sub) -> bytes`` and ``write(index, sub, data)``, which raise SdoAbort."""

    def __init__(self, read: Callable[[int, int], bytes], write: Callable[[int, int, bytes], None]) -> None:
        self._read = read
        self._write = write
        self._index = 0
        self._sub = 0
        self._upload: bytes | None = None
        self._download: bytes | None = None
        self._toggle = 0

    def answer(self, request: bytes) -> bytes:
        """The 8 bytes to send back; none to an abort or to what is no request."""
        if len(request) != 8 or request[0] == 0x80:
            self._upload = self._download = None
            return b""
        try:
            return self._dispatch(request[0], request)
        except SdoAbort as abort:
            self._upload = self._download = None
            return encode_abort(self._index, self._sub, abort.code)

    def _dispatch(self, command: int, request: bytes) -> bytes:
        kind = command >> 5
        if kind == 3 and self._upload is not None:
            return self._send_segment(command)
        if kind == 0 and self._download is not None:
            return self._take_segment(command, request)
        self._index, self._sub = struct.unpack_from("<HB", request, 1)
        if kind == 2:
            return self._start_upload()
        if kind == 1:
            return self._start_download(command, request)
        raise SdoAbort(COMMAND_ABORT)

    def _start_upload(self) -> bytes:
        data = self._read(self._index, self._sub)
        if 0 < len(data) <= 4:
            return struct.pack("<BHB4s", 0x43 | (4 - len(data)) << 2, self._index, self._sub, data)
        self._upload, self._toggle = data, 0
        return struct.pack("<BHBI", 0x41, self._index, self._sub, len(data))

    def _send_segment(self, command: int) -> bytes:
        self._check_toggle(command)
        data = self._upload or b""
        piece, rest = data[:7], data[7:]
        answer = struct.pack("<B7s", self._toggle | (7 - len(piece)) << 1 | (not rest), piece)
        self._upload = rest or None
        self._toggle ^= 0x10
        return answer

    def _start_download(self, command: int, request: bytes) -> bytes:
        if command & 0x02:
            size = 4 - (command >> 2 & 3) if command & 0x01 else 4
            self._write(self._index, self._sub, request[4 : 4 + size])
        else:
            self._download, self._toggle = b"", 0
        return struct.pack("<BHB4x", 0x60, self._index, self._sub)

    def _take_segment(self, command: int, request: bytes) -> bytes:
        self._check_toggle(command)
        data = (self._download or b"") + request[1 : 8 - (command >> 1 & 7)]
        self._download = data
        if command & 0x01:
            self._download = None
            self._write(self._index, self._sub, data)
        answer = struct.pack("<B7x", 0x20 | self._toggle)
        self._toggle ^= 0x10
        return answer

    def _check_toggle(self, command: int) -> None:
        if command & 0x10 != self._toggle:
            raise SdoAbort(TOGGLE_ABORT)
