"""The service's side of the process that takes stops from other computers: starts it, tells it, and replaces it."""

import contextlib
import os
import select
import socket
import subprocess
import sys
import threading
from collections.abc import Iterator
from pathlib import Path
from urllib.parse import urlsplit

from api.http.access.access import Access
from api.http.access.served_at import HTTPS, ServedAt, bracketed
from api.http.access.store import PrivateFile
from api.http.stops.known import AwaySettings, Known
from api.http.streams.events import EventLog
from rig.recording.ring import new_path

# It loads in 2 s beside a loop, and in ten times that where everything else goes first.
START_S = 30.0
# Twelve beats: whoever is so late takes no stop in time either.
SILENT_S = 3.0
PAUSE_S = 1.0
WARNING = 20
LOST = (
    "the process that takes stops from other computers does not answer and is started anew; meanwhile they go through"
    " the service alone, and on the bench's own computer as ever"
)
READY = "stops from other computers are taken beside the service"
MODULE = "api.http.stops.server"


class AwayStops:
    """The process that serves ``listeners``, which are this object's: its port stays when it is replaced."""

    def __init__(self, place: ServedAt, listeners: list[socket.socket]) -> None:
        self._place, self._listeners = place, listeners
        self.port: int = listeners[0].getsockname()[1]
        self._file = PrivateFile(new_path().with_suffix(".stops"), Known())
        self._lock, self._closing = threading.Lock(), threading.Event()
        self._page = ""
        self._access: Access | None = None
        self._process: subprocess.Popen[bytes] | None = None
        self._serving = False

    def address(self, host: str) -> str:
        """Where a page opened at ``host`` reaches it, with a proxy through that; empty while it does not serve."""
        if not self._serving:
            return ""
        return f"{self._place.proxy}/stops" if self._place.proxy else f"https://{bracketed(host)}:{self.port}"

    @property
    def pid(self) -> int:
        """Its process number; 0 before its first start."""
        return self._process.pid if self._process else 0

    def follow(self, page: Path) -> None:
        """From now on stops are for the bench whose stop word is at ``page``."""
        self._page = str(page)
        self._tell()

    @contextlib.contextmanager
    def running(self, access: Access, events: EventLog) -> Iterator[None]:
        """Around what is served: a process that has ended, or is frozen, is told of and replaced."""
        self._access = access
        access.logins.browsers.changed = self._tell
        self._tell()
        ending, ends = os.pipe()
        keeper = threading.Thread(target=self._keep, args=(access, events, ending), name="away-stops")
        keeper.start()
        try:
            yield
        finally:
            self._closing.set()
            os.close(ends)
            keeper.join()
            os.close(ending)
            self._file.path.unlink(missing_ok=True)

    def close(self) -> None:
        """Gives its port back."""
        for listener in self._listeners:
            listener.close()

    def _tell(self) -> None:
        with self._lock:
            logins = self._access.logins.browsers.held if self._access else ()
            try:
                self._file.write(Known(page=self._page, logins=logins))
            except OSError as error:
                sys.stderr.write(f"{self._file.path}: {error.strerror}: newer logins cannot stop past the service\n")

    def _keep(self, access: Access, events: EventLog, ending: int) -> None:
        while not self._closing.is_set():
            process = self._process = self._started(access, ending)
            within_s = START_S
            while _beats(process, within_s):
                within_s = SILENT_S
                if not self._serving:
                    self._serving = True
                    events.publish("service", "away-stops-ready", READY)
            _end(process)
            if self._serving and not self._closing.is_set():
                events.publish("service", "away-stops-lost", LOST, level=WARNING)
            self._serving = False
            self._closing.wait(PAUSE_S)

    def _started(self, access: Access, ending: int) -> "subprocess.Popen[bytes]":
        place = self._place
        settings = AwaySettings(
            known=self._file.path, access=access.folder, names=place.names, files=place.files, service_port=place.port,
            page_port=urlsplit(place.address).port or HTTPS,
        )  # fmt: skip
        fds = [listener.fileno() for listener in self._listeners]
        return subprocess.Popen(
            [sys.executable, "-m", MODULE, settings.model_dump_json(), *map(str, fds)],
            pass_fds=fds,
            stdin=ending,
            stdout=subprocess.PIPE,
            start_new_session=True,
        )


def _beats(process: "subprocess.Popen[bytes]", within_s: float) -> bool:
    """Waits for a sign of life."""
    assert process.stdout
    fd = process.stdout.fileno()
    readable, _, _ = select.select([fd], [], [], within_s)
    return bool(readable and os.read(fd, 4096))


def _end(process: "subprocess.Popen[bytes]") -> None:
    """In order, by the end of its input, before this; else at once."""
    process.kill()
    process.wait()
    if process.stdout:
        process.stdout.close()
