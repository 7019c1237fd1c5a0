"""The controller's side of the recorder process: starts it, tells it what to record, learns when it fails."""

import os
import subprocess
import sys
import tempfile
import time
from collections.abc import Mapping
from pathlib import Path
from types import TracebackType
from typing import Self

from rig.recording.lines import Lines, encode, parse
from rig.recording.mcap_file import RecordingFailed

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
        command = [sys.executable, "-P", "-m", "rig.recording.recorder", str(ring), *(["--resume"] if resume else [])]
        self._process = subprocess.Popen(
            command,
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            stderr=self._complaints,
            bufsize=0,
            start_new_session=True,
        )
        if self._process.stdin is None or self._process.stdout is None:
            raise RecordingFailed("the recorder process has no pipes")
        self._commands, self._replies = self._process.stdin, self._process.stdout
        self._lines = Lines(self._replies.fileno())
        self._failure = self._end = ""
        try:
            self._await("ready", "start", START_TIMEOUT_S)
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
        if not self._replies.closed:
            for line in self._lines.wait(0):
                self._note(parse(line))
        return self._failure or ("" if self.alive else self._epitaph())

    def open(self, path: Path, metadata: Mapping[str, Mapping[str, str]]) -> None:
        """Starts a recording: everything published from now on goes to ``path`` (an existing file is refused)."""
        self._failure = ""
        self._send({"open": str(path.absolute()), "metadata": {name: dict(items) for name, items in metadata.items()}})
        self._await("opened", "open", OPEN_TIMEOUT_S)

    def close(self, summary: Mapping[str, str]) -> dict[str, object]:
        """Finishes the recording with everything published until now.

        Returns ``closed`` (path), ``samples``, ``dropped``, ``missing`` (per stream) and ``unreadable`` (number).
        """
        self._send({"close": dict(summary)})
        return self._await("closed", "close", CLOSE_TIMEOUT_S)

    def quit(self) -> None:
        """Ends the process, finishing what is open; may be called twice and also after its death."""
        if not self._commands.closed:
            try:
                self._commands.write(encode({"quit": True}))
                self._process.wait(QUIT_TIMEOUT_S)
            except (BrokenPipeError, subprocess.TimeoutExpired):
                self._process.kill()
        self._release()

    def kill(self) -> None:
        """Ends the process at once, as a crash would."""
        self._process.kill()
        self._release()

    def _release(self) -> None:
        self._process.wait()
        self._commands.close()
        self._replies.close()
        self._end = self._epitaph()
        self._complaints.close()

    def _send(self, message: dict[str, object]) -> None:
        try:
            if self._commands.closed:
                raise BrokenPipeError
            self._commands.write(encode(message))
        except BrokenPipeError as error:
            raise RecordingFailed(self._epitaph()) from error

    def _await(self, key: str, name: str, timeout_s: float) -> dict[str, object]:
        deadline = time.monotonic() + timeout_s
        while (left_s := deadline - time.monotonic()) > 0 and not self._lines.ended:
            replies = [parse(line) for line in self._lines.wait(left_s)]
            for reply in replies:
                self._note(reply)
            for reply in replies:
                if key in reply:
                    return reply
                if reply.get("to") in (name, "line"):
                    raise RecordingFailed(str(reply["failed"]))
        if self._lines.ended:
            raise RecordingFailed(self._epitaph())
        raise RecordingFailed(f"the recorder did not answer {name} within {timeout_s:g} s; the disk may be stalled")

    def _note(self, reply: dict[str, object]) -> None:
        if reply.get("to") == "recording":
            self._failure = str(reply["failed"])

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
