"""The controller's side of the recorder process: starts it, tells it what to record, learns when it fails."""

import os
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable, Mapping
from pathlib import Path
from select import select
from types import TracebackType
from typing import Self

from rig.channel import Answer, Channel, Message, Received, Reply, pair
from rig.recording.mcap_file import RecordingFailed
from rig.recording.messages import FROM_RECORDER, Close, Closed, Open, Quit, RecorderFailed, Started

# A recorder imports for one or two seconds; a busy computer takes ten times that, and so may a disk that wakes.
START_TIMEOUT_S = 20.0
OPEN_TIMEOUT_S = 20.0
# A close drains up to a whole ring and waits for the disk.
CLOSE_TIMEOUT_S = 60.0
QUIT_TIMEOUT_S = 60.0


class RecorderClient:
    """A running recorder. Methods raise RecordingFailed with the recorder's own sentence, or with how it died."""

    def __init__(self, ring: Path, resume: bool = False) -> None:
        """Starts the process on ``ring``; ``resume`` hands what a dead recorder left there to the first recording."""
        self._complaints = tempfile.TemporaryFile()  # noqa: SIM115 - lives as long as the process
        mine, theirs = pair()
        command = [sys.executable, "-P", "-m", "rig.recording.recorder", str(ring), str(theirs.fileno())]
        self._process = subprocess.Popen(
            [*command, *(["--resume"] if resume else [])],
            pass_fds=[theirs.fileno()],
            stdin=subprocess.DEVNULL,
            stdout=subprocess.DEVNULL,
            stderr=self._complaints,
            start_new_session=True,
        )
        theirs.close()
        self._channel = Channel(mine, FROM_RECORDER)
        self._failure = self._end = ""
        try:
            self._await(lambda message: isinstance(message, Started), "start", START_TIMEOUT_S)
        except RecordingFailed:
            self.kill()
            raise

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.quit()

    @property
    def alive(self) -> bool:
        """Whether the process runs."""
        return self._process.poll() is None

    @property
    def pid(self) -> int:
        """Its process number."""
        return self._process.pid

    @property
    def failure(self) -> str:
        """Why the recording in progress failed, empty while it has not; never waits."""
        if not self._channel.lost:
            for received in self._channel.receive_all():
                self._note(received)
        return self._failure or ("" if self.alive else self._epitaph())

    def open(self, path: Path, metadata: Mapping[str, Mapping[str, str]]) -> None:
        """Starts a recording: everything published from now on goes to ``path`` (an existing file is refused)."""
        self._failure = ""
        record = {name: dict(items) for name, items in metadata.items()}
        self._ask(Open(path=str(path.absolute()), metadata=record), "open", OPEN_TIMEOUT_S)

    def close(self, summary: Mapping[str, str]) -> Closed:
        """Finishes the recording with everything published until now."""
        closed = self._ask(Close(summary=dict(summary)), "close", CLOSE_TIMEOUT_S)
        assert isinstance(closed, Closed)
        return closed

    def quit(self) -> None:
        """Ends the process, finishing what is open; may be called twice and also after its death."""
        if not self._channel.lost:
            self._channel.send(Quit())
            try:
                self._process.wait(QUIT_TIMEOUT_S)
            except subprocess.TimeoutExpired:
                self._process.kill()
        self._release()

    def kill(self) -> None:
        """Ends the process at once, as a crash would."""
        self._process.kill()
        self._release()

    def _release(self) -> None:
        self._process.wait()
        self._channel.close()
        self._end = self._epitaph()
        self._complaints.close()

    def _ask(self, command: Message, name: str, timeout_s: float) -> Message:
        if self._channel.lost:
            raise RecordingFailed(self._epitaph())
        number = self._channel.send(command)
        if not number and not self._channel.lost:
            raise RecordingFailed(f"the recorder cannot be told to {name}: the message is too large")
        answer = self._await(lambda said: isinstance(said, Reply) and said.to == number, name, timeout_s)
        if isinstance(answer, Answer):
            raise RecordingFailed(answer.refused)
        return answer

    def _await(self, wanted: Callable[[Message], bool], name: str, timeout_s: float) -> Message:
        deadline = time.monotonic() + timeout_s
        while (left_s := deadline - time.monotonic()) > 0 and not self._channel.lost:
            waiting = [] if self._channel.flush() else [self._channel]
            select([self._channel], waiting, [], left_s)
            for received in self._channel.receive_all():
                self._note(received)
                if wanted(received.message):
                    return received.message
                if name == "start" and self._failure:
                    raise RecordingFailed(self._failure)
        if self._channel.lost:
            raise RecordingFailed(self._epitaph())
        raise RecordingFailed(f"the recorder did not answer {name} within {timeout_s:g} s; the disk may be stalled")

    def _note(self, received: Received) -> None:
        if isinstance(received.message, RecorderFailed):
            self._failure = received.message.text

    def _epitaph(self) -> str:
        if self._end:
            return self._end
        code = self._process.wait(QUIT_TIMEOUT_S)
        size = self._complaints.seek(0, os.SEEK_END)
        self._complaints.seek(max(size - 1000, 0))
        last = self._complaints.read().decode(errors="replace").strip().rpartition("\n")[2]
        return (
            f"the recorder process ended (exit code {code}{': ' + last if last else ''}); what it had written opens, "
            "see `rig verify`"
        )
