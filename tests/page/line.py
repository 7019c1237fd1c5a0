"""A line between browser and service that can be cut and mended, as that of another computer."""

import contextlib
import socket
import threading

from mock_devices.testing.commands import free_port

HERE = "127.0.0.1"


class Line:
    """Passes on what comes to ``port``; while it is cut every connection is broken, and none begins."""

    def __init__(self, far_port: int) -> None:
        self._far_port, self._ends, self._is_cut = far_port, list[socket.socket](), False
        self.port = free_port()
        self._listening = socket.create_server((HERE, self.port))
        self._thread = threading.Thread(target=self._take, name="line")
        self._thread.start()

    def cut(self) -> None:
        """Until it is mended."""
        self._is_cut = True
        for end in self._ends:
            _break(end)

    def mend(self) -> None:
        """From now on connections begin again."""
        self._is_cut = False

    def close(self) -> None:
        """For good."""
        _break(self._listening)
        self._thread.join()
        self.cut()
        for end in (self._listening, *self._ends):
            end.close()

    def _take(self) -> None:
        with contextlib.suppress(OSError):
            while True:
                near, _ = self._listening.accept()
                self._ends.append(near)
                self._join(near)

    def _join(self, near: socket.socket) -> None:
        if self._is_cut:
            return _break(near)
        try:
            far = socket.create_connection((HERE, self._far_port))
        except OSError:
            return _break(near)
        self._ends.append(far)
        for source, sink in ((near, far), (far, near)):
            threading.Thread(target=_pass, args=(source, sink), daemon=True).start()
        return None


def _pass(source: socket.socket, sink: socket.socket) -> None:
    with contextlib.suppress(OSError):
        while data := source.recv(65_536):
            sink.sendall(data)
    _break(source)
    _break(sink)


def _break(end: socket.socket) -> None:
    with contextlib.suppress(OSError):
        end.shutdown(socket.SHUT_RDWR)
