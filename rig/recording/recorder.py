"""The recorder process: drains the ring and does all the waiting for the disk, so that the loop never has to.

Started as ``python -m rig.recording.recorder RING SOCKET_FD``; commands and replies are those of
`rig.recording.messages`, over the channel at the other end of the socket.

A command that fails is answered with its reason; a disk that fails meanwhile is reported at once, and again on close.
Slots are given back to the loop only after their chunk has been handed to the system: a successor of a killed recorder
(``--resume``) starts with the batch that was lost. When the channel is closed, the supervisor is dead: the recorder
goes on while the loop still writes, then finishes file and itself.
"""

import argparse
import contextlib
import json
import signal
import socket
import sys
import threading
import time
from collections import Counter
from collections.abc import Iterator, Mapping
from pathlib import Path
from select import select
from typing import cast

import numpy as np
from numpy.typing import NDArray

from rig.channel import Answer, Channel, Message, Received
from rig.channels import BY_ID, Stream
from rig.errors import RigError
from rig.recording.mcap_file import RecordingFailed, RecordingWriter
from rig.recording.messages import TO_RECORDER, Close, Closed, Open, Opened, Quit, RecorderFailed, Started
from rig.recording.ring import RingReader
from rig.recording.slots import Slots, bodies_of, rows_of

DRAIN_PERIOD_S = 0.2  # a flush period, and commands wake it at once: a turn costs as much as 400 rows
FLUSH_PERIOD_NS = 200_000_000  # what dies with the process: less than the loading of the fastest trial, 8 mm at 30 mm/s
SYNC_PERIOD_NS = 1_000_000_000  # what a power failure takes; a sync was seen to last 0.13 s
SILENCE_NS = 2_000_000_000  # twice the longest pause after which a loop still goes on (`loop.overrun_ms`)
BATCH = 8192  # 5 ms of writing at 0.6 us a row; then commands are looked at again


class Tally:
    """What one recording got: samples and gaps in their numbers, per stream."""

    def __init__(self, streams: Mapping[int, Stream] = BY_ID) -> None:
        self.streams = streams
        self.samples: Counter[str] = Counter()
        self.missing: Counter[str] = Counter()
        self.unreadable = 0
        self._last: dict[int, int] = {}

    def accepted(self, slots: Slots) -> Iterator[tuple[Stream, bytes]]:
        """Streams and their bodies: of one with text one at a time, else all that came together.

        What has not the layout of its stream would spoil the file: it is counted and left out.
        """
        self.unreadable += slots.size
        for stream in self.streams.values():
            if stream.has_text:
                for body, row in bodies_of(slots, stream):
                    self._count(stream, np.array([row[0]]))
                    yield stream, body
            elif (rows := rows_of(slots, stream)).size:
                self._count(stream, rows["seq"])
                yield stream, rows.tobytes()

    def _count(self, stream: Stream, seqs: NDArray[np.int64]) -> None:
        known = np.concatenate(([self._last.get(stream.id, seqs[0])], seqs))
        self.missing[stream.name] += int(np.maximum(known[1:] - known[:-1] - 1, 0).sum())
        self.samples[stream.name] += seqs.size
        self.unreadable -= seqs.size
        self._last[stream.id] = int(seqs[-1])


class Recorder:
    """Ring to files. Time and commands are given; ``step`` is to be called as often as a flush is due."""

    def __init__(self, ring: RingReader, resume: bool = False) -> None:
        """With ``resume`` what a predecessor left in the ring stays there for the first recording."""
        self._ring = ring
        self._hold = resume
        self._writer: RecordingWriter | None = None
        self._failure = ""
        self._tally = Tally()
        self._dropped, self._damaged = ring.dropped, ring.damaged
        self._flushed_ns = self._synced_ns = 0
        self.unrecorded = 0

    @property
    def recording(self) -> bool:
        """Whether a recording was opened and not closed, be it a failed one."""
        return self._writer is not None

    def handle(self, received: Received) -> Message:
        """Does what one command asks and says how it went."""
        number = received.id
        try:
            match received.message:
                case Open(path=path, metadata=metadata):
                    return self._open(number, Path(path), metadata)
                case Close(summary=summary):
                    return self._close(number, summary)
                case Quit():
                    self.end("recorder told to quit")
                    return Answer(to=number)
        except RigError as error:
            return Answer(to=number, refused=str(error))
        return Answer(to=number, refused="this is no command of a recorder")

    def step(self, now_ns: int) -> RecorderFailed | None:
        """Drains the ring and flushes when it is time; returns the news if the disk failed just now."""
        self._ring.touch(now_ns)
        try:
            self._drain(BATCH)
            if self._writer and not self._failure and now_ns - self._flushed_ns >= FLUSH_PERIOD_NS:
                self._flush(self._writer, now_ns)
        except RecordingFailed as error:
            self._failure = str(error)
            self._ring.commit()
            return RecorderFailed(text=self._failure)
        return None

    def end(self, outcome: str) -> None:
        """Finishes a recording that is still open."""
        if self._writer:
            self._close(0, {"outcome": outcome})

    def _open(self, number: int, path: Path, metadata: dict[str, dict[str, str]]) -> Opened:
        if self._writer and not self._failure:
            raise RecordingFailed(f"{path}: {self._writer.path} is still being recorded; close it first")
        self._writer = None
        if not self._hold:
            self._drain_to(self._ring.head)
            self._dropped, self._damaged = self._ring.dropped, self._ring.damaged
        self._writer = RecordingWriter(path, metadata)
        self._hold, self._failure, self._tally = False, "", Tally(self._writer.streams)
        unrecorded, self.unrecorded = self.unrecorded, 0
        return Opened(to=number, path=str(path), unrecorded=unrecorded)

    def _close(self, number: int, summary: dict[str, str]) -> Closed:
        if self._writer is None:
            raise RecordingFailed("nothing is being recorded; open a recording first")
        writer = self._writer
        try:
            self._drain_to(self._ring.head)
            if self._failure:
                raise RecordingFailed(self._failure)
            closed = self._counted(number, writer.path)
            counts = closed.model_dump(exclude={"to", "path"})
            writer.finish({**summary, **{name: json.dumps(value) for name, value in counts.items()}})
        finally:
            self._writer, self._failure = None, ""
            writer.close()
            self._ring.commit()
        return closed

    def _counted(self, number: int, path: Path) -> Closed:
        dropped, known = Counter(self._ring.dropped), self._tally.streams
        dropped.subtract(self._dropped)
        return Closed(
            to=number,
            path=str(path),
            samples=dict(self._tally.samples),
            dropped={known[stream].name: count for stream, count in dropped.items() if count and stream in known},
            missing={name: count for name, count in self._tally.missing.items() if count},
            unreadable=self._tally.unreadable + self._ring.damaged - self._damaged,
        )

    def _drain_to(self, head: int) -> None:
        while self._ring.position < head:
            self._drain(min(BATCH, head - self._ring.position))

    def _drain(self, limit: int) -> None:
        if self._hold:
            return
        writing = self._writer is not None and not self._failure
        slots = self._ring.drain(limit, commit=not writing)
        if not writing or self._writer is None:
            self.unrecorded += slots.size
            return
        for stream, body in self._tally.accepted(slots):
            self._writer.add(stream.id, body)

    def _flush(self, writer: RecordingWriter, now_ns: int) -> None:
        sync = now_ns - self._synced_ns >= SYNC_PERIOD_NS
        writer.flush(sync)
        self._ring.commit()
        self._flushed_ns = now_ns
        self._synced_ns = now_ns if sync else self._synced_ns


def run(ring: RingReader, recorder: Recorder, channel: Channel, ending: threading.Event) -> None:
    """Serves commands until told to quit, until supervisor and loop are both gone, or until ``ending`` is set."""
    while not channel.lost:
        if ending.is_set():
            with contextlib.suppress(RecordingFailed):
                recorder.end("recorder ended by a signal")
            return
        behind = recorder.recording and ring.head - ring.position > BATCH
        select([channel], [], [], 0.0 if behind else DRAIN_PERIOD_S)
        for received in channel.receive_all():
            channel.send(recorder.handle(received))
            if isinstance(received.message, Quit):
                return
        news = recorder.step(time.monotonic_ns())
        if news:
            channel.send(news)
        channel.flush()
    _outlive(ring, recorder)


def _outlive(ring: RingReader, recorder: Recorder) -> None:
    """The supervisor is dead: records while the loop still writes, then closes the file and removes the ring."""
    head, moved_ns = ring.head, time.monotonic_ns()
    while time.monotonic_ns() - moved_ns < SILENCE_NS:
        time.sleep(DRAIN_PERIOD_S)
        recorder.step(time.monotonic_ns())
        if ring.head != head:
            head, moved_ns = ring.head, time.monotonic_ns()
    with contextlib.suppress(RecordingFailed):
        recorder.end("supervisor lost")
    ring.path.unlink(missing_ok=True)


def main(arguments: list[str]) -> int:
    """The process: attaches to the ring and runs; exit code 2 where there is no ring."""
    parser = argparse.ArgumentParser(prog="python -m rig.recording.recorder", description=__doc__)
    parser.add_argument("ring", type=Path)
    parser.add_argument("socket", type=int, metavar="SOCKET_FD")
    parser.add_argument("--resume", action="store_true", help="keep what a predecessor left for the first recording")
    options = parser.parse_args(arguments)
    # Ctrl-C goes to the whole group of processes; the recorder ends when its supervisor says so or is gone.
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    # A terminal that is closed or a computer that shuts down leaves a finished file.
    ending = threading.Event()
    for number in (signal.SIGHUP, signal.SIGTERM):
        signal.signal(number, lambda *_: ending.set())
    channel = Channel(socket.socket(fileno=cast(int, options.socket)), TO_RECORDER)
    try:
        ring = RingReader.open(cast(Path, options.ring))
    except RigError as error:
        channel.send(RecorderFailed(text=str(error)))
        return error.exit_code
    ring.touch(time.monotonic_ns())
    channel.send(Started())
    run(ring, Recorder(ring, options.resume), channel, ending)
    channel.close()
    ring.close()
    return 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
