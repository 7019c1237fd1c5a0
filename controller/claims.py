"""Who uses a bench: one small file a port in the user's state folder, locked as long as its user or its loop lives.

The lock is the kernel's (flock) and ends with the last process that holds it, however that ends. What stays in a file
that nobody locks is a session that did not end in order.
"""

import contextlib
import fcntl
import json
import os
import sys
import tempfile
import time
from collections.abc import Callable, Sequence
from dataclasses import asdict, dataclass
from datetime import UTC, datetime
from pathlib import Path
from urllib.parse import quote

from rig.config.wiring import Wiring
from rig.errors import DeviceError

# A loop that lost its supervisor retracts and leaves: 60 mm at 10 mm/s, then the drive's own stop.
LEAVING_S = 20.0
LOOK_S = 0.1


@dataclass(frozen=True)
class Holder:
    """Who uses a port: ``address`` is where its service listens, empty without one; ``node`` tells the port's file."""

    port: str
    pid: int
    command: str
    address: str
    since: str
    node: str

    @property
    def sentence(self) -> str:
        """For whoever wanted the port."""
        page = f", or use it at {self.address}" if self.address else ""
        who = f"`{self.command}` (process {self.pid})"
        return f"{self.port} is in use by {who} since {self.since}; end that first{page}"


def command_line() -> str:
    """What this process was called as."""
    return " ".join([Path(sys.argv[0]).name, *sys.argv[1:2]])


def state_folder() -> Path:
    """Where the files are; one that can be written in any case."""
    home = Path(os.environ.get("XDG_STATE_HOME") or Path.home() / ".local" / "state")
    for folder in (home / "tissue-rig", Path(tempfile.gettempdir()) / f"tissue-rig-{os.getuid()}"):
        with contextlib.suppress(OSError):
            folder.mkdir(parents=True, exist_ok=True)
            if os.access(folder, os.W_OK):
                return folder
    raise DeviceError(f"{home}: no folder to note in who uses the bench; set XDG_STATE_HOME to one that can be written")


def ports(wiring: Wiring) -> tuple[str, ...]:
    """The bench's ports, each once, the axis' first."""
    tracker = [wiring.tracker.port] if wiring.tracker else []
    return tuple(dict.fromkeys([wiring.axis.port, wiring.force.port, *tracker]))


class Claim:
    """Ports that are this process' until ``release``; ``fds`` are handed to the loop, so that they stay as long as it.

    ``unfinished`` says what the session before left on the axis; it stays noted until ``finished`` is set.
    """

    def __init__(self, folder: Path, held: Sequence[tuple[Path, int]], unfinished: Holder | None) -> None:
        self._folder, self._held = folder, list(held)
        self._before = unfinished
        self.finished = unfinished is None

    @property
    def fds(self) -> list[int]:
        """Descriptors that keep the locks."""
        return [fd for _, fd in self._held]

    @property
    def unfinished(self) -> str:
        """One sentence; empty where the session before ended in order."""
        before = self._before
        if before is None:
            return ""
        return (
            f"the session before (`{before.command}`, process {before.pid}, since {before.since}) did not end in order;"
            " the tip may still be in the tissue"
        )

    def leave_note(self) -> None:
        """The tip may stay in the tissue: whoever starts next is told."""
        if self._held and self._before is None:
            self._before, self.finished = _read(self._held[0][1]), False

    def release(self) -> None:
        """Gives the ports back; may be called twice."""
        for number, (path, fd) in enumerate(self._held):
            if self.finished or number > 0:
                path.unlink(missing_ok=True)
            elif self._before:
                _write(fd, self._before)
            os.close(fd)
        self._held = []


def take(wiring: Wiring, address: str = "", now: Callable[[], float] = time.monotonic) -> Claim:
    """Takes the bench's ports; raises DeviceError naming who has one. A loop left alone is given time to leave."""
    folder = state_folder()
    held: list[tuple[Path, int]] = []
    unfinished = None
    try:
        for port in ports(wiring):
            path = _path(folder, port)
            fd = _locked(path, now)
            held.append((path, fd))
            before = _read(fd)
            if before and port == wiring.axis.port and before.node == _node(port):
                unfinished = before
            _write(fd, _me(port, address))
    except BaseException:
        Claim(folder, held, unfinished).release()
        raise
    return Claim(folder, held, unfinished)


def holder(wiring: Wiring) -> Holder | None:
    """Who uses one of the bench's ports now."""
    folder = state_folder()
    for port in ports(wiring):
        with contextlib.suppress(FileNotFoundError):
            fd = os.open(_path(folder, port), os.O_RDWR | os.O_CLOEXEC)
            try:
                fcntl.flock(fd, fcntl.LOCK_EX | fcntl.LOCK_NB)
            except BlockingIOError:
                found = _read(fd)
                if found:
                    return found
            finally:
                os.close(fd)
    return None


def _path(folder: Path, port: str) -> Path:
    return folder / f"{quote(os.path.realpath(port) if port.startswith('/') else port, safe='')}.json"


def _locked(path: Path, now: Callable[[], float]) -> int:
    deadline_s = now() + LEAVING_S
    while True:
        fd = os.open(path, os.O_RDWR | os.O_CREAT | os.O_CLOEXEC, 0o600)
        try:
            fcntl.flock(fd, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except BlockingIOError:
            found = _read(fd)
            os.close(fd)
            if found and (_lives(found.pid) or now() > deadline_s):
                raise DeviceError(found.sentence) from None
            time.sleep(LOOK_S)
            continue
        if _is_still(path, fd):
            return fd
        os.close(fd)


def _is_still(path: Path, fd: int) -> bool:
    """Whether the locked file is the one others will find: it may have been given back in between."""
    try:
        return os.path.samestat(path.stat(), os.fstat(fd))
    except FileNotFoundError:
        return False


def _lives(pid: int) -> bool:
    """Whether that process runs; one that was killed and is not yet fetched by its parent does not."""
    try:
        return Path(f"/proc/{pid}/stat").read_text().rpartition(")")[2].split()[0] != "Z"
    except OSError:
        return False


def _node(port: str) -> str:
    """Tells this port's file from another that had the same name: a pseudo-terminal opened anew is another bench."""
    if not port.startswith("/dev/pts/"):
        return ""
    with contextlib.suppress(OSError):
        status = Path(port).stat()
        return f"{status.st_ino}-{status.st_ctime_ns}"
    return ""


def _me(port: str, address: str) -> Holder:
    since = datetime.now(UTC).astimezone().isoformat(timespec="seconds")
    return Holder(port, os.getpid(), command_line(), address, since, _node(port))


def _write(fd: int, content: Holder) -> None:
    os.ftruncate(fd, 0)
    os.pwrite(fd, json.dumps(asdict(content)).encode(), 0)


def _read(fd: int) -> Holder | None:
    try:
        return Holder(**json.loads(os.pread(fd, 65536, 0)))
    except (ValueError, TypeError):
        return None
