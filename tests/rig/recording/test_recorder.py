"""What the recorder does with commands, samples and a bad disk; time is given, no process is started."""

import json
import socket
import threading
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest

from rig.channel import Answer, Channel, Received
from rig.channels import AXIS, EVENT, FORCE
from rig.recording import recorder as process
from rig.recording.messages import TO_RECORDER, Close, Open, Quit
from rig.recording.reader import read_recording
from rig.recording.recorder import BATCH, DRAIN_PERIOD_S, FLUSH_PERIOD_NS, Recorder
from rig.recording.ring import RingReader, RingWriter
from tests.rig.recording.conftest import METADATA, axis, event, force
from tests.rig.recording.test_mcap_file import disk_of

MS = 1_000_000


@pytest.fixture
def ring(tmp_path: Path) -> Iterator[RingWriter]:
    writer = RingWriter.create(tmp_path / "ring", slots=256)
    yield writer
    writer.close()


@pytest.fixture
def reader(ring: RingWriter) -> Iterator[RingReader]:
    end = RingReader.open(ring.path)
    yield end
    end.close()


@pytest.fixture
def recorder(reader: RingReader) -> Recorder:
    return Recorder(reader)


def opened(recorder: Recorder, path: Path, metadata: dict[str, dict[str, str]] | None = None) -> dict[str, Any]:
    command = Open(path=str(path), metadata=metadata or {})
    return recorder.handle(Received(1, command)).model_dump()


def closed(recorder: Recorder, **summary: str) -> dict[str, Any]:
    return recorder.handle(Received(2, Close(summary=summary))).model_dump()


def put_force(ring: RingWriter, *seqs: int) -> None:
    for seq in seqs:
        ring.put(FORCE.id, FORCE.pack(force(seq)))


def seqs_in(path: Path) -> list[int]:
    return [int(seq) for seq in read_recording(path).tables["force"]["seq"]]


def test_a_recording_holds_what_was_published_between_open_and_close(
    ring: RingWriter, recorder: Recorder, tmp_path: Path
) -> None:
    path = tmp_path / "a.mcap"
    put_force(ring, 0, 1)
    assert opened(recorder, path, METADATA) == {"to": 1, "path": str(path), "unrecorded": 2}
    put_force(ring, 2, 3)
    ring.put(AXIS.id, AXIS.pack(axis(0)))
    ring.put(EVENT.id, EVENT.pack(event(0)))
    reply = closed(recorder, outcome="done")
    put_force(ring, 4)
    assert reply == {
        "to": 2,
        "path": str(path),
        "samples": {"force": 2, "axis": 1, "event": 1},
        "dropped": {},
        "missing": {},
        "unreadable": 0,
    }
    recording = read_recording(path)
    assert seqs_in(path) == [2, 3]
    assert recording.complete
    assert {name: recording.metadata[name] for name in METADATA} == METADATA
    assert recording.metadata["summary"]["outcome"] == "done"
    assert json.loads(recording.metadata["summary"]["samples"]) == {"force": 2, "axis": 1, "event": 1}


def test_samples_between_recordings_are_unrecorded_not_dropped(
    ring: RingWriter, recorder: Recorder, tmp_path: Path
) -> None:
    for name in ("a", "b"):
        opened(recorder, tmp_path / f"{name}.mcap")
        reply = closed(recorder)
        assert reply["dropped"] == reply["missing"] == {}
        put_force(ring, *range(200))
        recorder.step(0)
        assert recorder.unrecorded == 200


def test_gaps_in_the_numbers_are_counted_as_missing(ring: RingWriter, recorder: Recorder, tmp_path: Path) -> None:
    opened(recorder, tmp_path / "a.mcap")
    put_force(ring, 5, 6, 9, 10, 12)
    assert closed(recorder)["missing"] == {"force": 3}


def test_gaps_between_two_turns_are_counted_and_what_came_before_the_first_is_none(
    ring: RingWriter, recorder: Recorder, tmp_path: Path
) -> None:
    opened(recorder, tmp_path / "a.mcap")
    for seqs in ((100, 101), (104,), (103, 106)):
        put_force(ring, *seqs)
        recorder.step(0)
    assert closed(recorder)["missing"] == {"force": 2 + 2}


def test_drops_during_a_recording_are_counted_per_stream(ring: RingWriter, recorder: Recorder, tmp_path: Path) -> None:
    put_force(ring, *range(300))
    opened(recorder, tmp_path / "a.mcap")
    assert ring.dropped == {FORCE.id: 44}
    put_force(ring, *range(300, 570))
    ring.put(AXIS.id, AXIS.pack(axis(0)))
    reply = closed(recorder)
    assert reply["dropped"] == {"force": 14, "axis": 1}
    assert reply["samples"] == {"force": 256}


def test_slots_are_given_back_only_after_their_chunk_is_in_the_file(
    ring: RingWriter, reader: RingReader, recorder: Recorder, tmp_path: Path
) -> None:
    path = tmp_path / "a.mcap"
    opened(recorder, path)
    now_ns = 10 * FLUSH_PERIOD_NS
    recorder.step(now_ns)
    put_force(ring, 0, 1, 2)
    recorder.step(now_ns + FLUSH_PERIOD_NS - 1)
    assert (reader.position, reader.tail, seqs_in(path)) == (3, 0, [])
    recorder.step(now_ns + FLUSH_PERIOD_NS)
    assert (reader.position, reader.tail, seqs_in(path)) == (3, 3, [0, 1, 2])


def test_each_turn_of_the_process_hands_over_what_it_took(
    ring: RingWriter, reader: RingReader, recorder: Recorder, tmp_path: Path
) -> None:
    """A turn that only takes rows costs as much as 400 of them; 8 mm at 30 mm/s are loaded in 0.27 s."""
    opened(recorder, tmp_path / "a.mcap")
    for turn in range(1, 5):
        put_force(ring, turn)
        recorder.step(turn * round(DRAIN_PERIOD_S * 1e9))
        assert reader.tail == ring.head == turn
    assert DRAIN_PERIOD_S < 8 / 30


def test_a_recorder_that_is_behind_does_not_wait(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """A wait for each batch would be 41,000 rows a second."""
    ring = RingWriter.create(tmp_path / "ring", slots=1 << 15)
    reader, waits, ending = RingReader.open(ring.path), list[float](), threading.Event()
    recorder = Recorder(reader)
    opened(recorder, tmp_path / "a.mcap")
    put_force(ring, *range(3 * BATCH + 1))

    def select(*asked: Any) -> tuple[list[Any], list[Any], list[Any]]:
        waits.append(asked[-1])
        if waits[-1] > 0:
            ending.set()
        return [], [], []

    monkeypatch.setattr(process, "select", select)
    ours, theirs = socket.socketpair()
    with ours, theirs:
        process.run(reader, recorder, Channel(ours, TO_RECORDER), ending)
    assert waits == [0.0, 0.0, 0.0, DRAIN_PERIOD_S]
    assert seqs_in(tmp_path / "a.mcap") == list(range(3 * BATCH + 1))
    reader.close()
    ring.close()


def test_a_successor_waits_for_its_first_recording_without_haste(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    ring = RingWriter.create(tmp_path / "ring", slots=1 << 14)
    put_force(ring, *range(BATCH + 1))
    reader, waits, ending = RingReader.open(ring.path), list[float](), threading.Event()

    def select(*asked: Any) -> tuple[list[Any], list[Any], list[Any]]:
        waits.append(asked[-1])
        ending.set()
        return [], [], []

    monkeypatch.setattr(process, "select", select)
    ours, theirs = socket.socketpair()
    with ours, theirs:
        process.run(reader, Recorder(reader, resume=True), Channel(ours, TO_RECORDER), ending)
    assert waits == [DRAIN_PERIOD_S]
    reader.close()
    ring.close()


def test_a_successor_starts_with_the_batch_its_predecessor_lost(ring: RingWriter, tmp_path: Path) -> None:
    first = RingReader.open(ring.path)
    doomed = Recorder(first)
    opened(doomed, tmp_path / "a.mcap")
    put_force(ring, 0, 1)
    doomed.step(FLUSH_PERIOD_NS)
    put_force(ring, 2, 3)
    doomed.step(FLUSH_PERIOD_NS + MS)
    first.close()
    second = RingReader.open(ring.path)
    heir = Recorder(second, resume=True)
    heir.step(0)
    opened(heir, tmp_path / "b.mcap")
    put_force(ring, 4)
    closed(heir)
    second.close()
    assert (seqs_in(tmp_path / "a.mcap"), seqs_in(tmp_path / "b.mcap")) == ([0, 1], [2, 3, 4])


def test_each_step_leaves_a_sign_of_life(ring: RingWriter, recorder: Recorder) -> None:
    recorder.step(123 * MS)
    assert ring.reader_age_ns(125 * MS) == 2 * MS


def test_a_full_disk_is_told_at_once_and_again_on_close_and_the_next_recording_works(
    ring: RingWriter, recorder: Recorder, tmp_path: Path
) -> None:
    path = tmp_path / "a.mcap"
    opened(recorder, path, METADATA)
    now_ns, news = 0, None
    with disk_of(12_000):
        for start in range(0, 10_000, 100):
            put_force(ring, *range(start, start + 100))
            now_ns += FLUSH_PERIOD_NS
            news = recorder.step(now_ns)
            if news:
                break
        assert news is not None
        assert "File too large" in news.text
        assert recorder.step(now_ns + FLUSH_PERIOD_NS) is None
    assert closed(recorder) == {"to": 2, "refused": news.text, "stopped": False}
    kept = seqs_in(path)
    assert kept == list(range(len(kept)))
    assert len(kept) >= 100
    assert "path" in opened(recorder, tmp_path / "b.mcap")
    put_force(ring, 1)
    assert closed(recorder)["samples"] == {"force": 1}


def test_a_disk_that_fills_up_on_close_is_a_failed_close(ring: RingWriter, recorder: Recorder, tmp_path: Path) -> None:
    opened(recorder, tmp_path / "a.mcap")
    put_force(ring, *range(200))
    with disk_of(6_000):
        reply = closed(recorder)
    assert "File too large" in reply["refused"]
    assert not read_recording(tmp_path / "a.mcap").complete


def test_samples_that_would_spoil_the_file_are_counted_and_left_out(
    ring: RingWriter, recorder: Recorder, tmp_path: Path
) -> None:
    opened(recorder, tmp_path / "a.mcap")
    ring.put(FORCE.id, b"short")
    ring.put(AXIS.id, FORCE.pack(force(0)))
    ring.put(EVENT.id, EVENT.pack(event(0))[:-30])
    ring.put(63, b"")
    put_force(ring, 0)
    reply = closed(recorder)
    assert (reply["unreadable"], reply["samples"]) == (4, {"force": 1})
    assert seqs_in(tmp_path / "a.mcap") == [0]


def test_opening_twice_is_refused_and_the_first_goes_on(ring: RingWriter, recorder: Recorder, tmp_path: Path) -> None:
    opened(recorder, tmp_path / "a.mcap")
    reply = opened(recorder, tmp_path / "b.mcap")
    assert "still being recorded" in reply["refused"]
    put_force(ring, 0)
    assert closed(recorder)["samples"] == {"force": 1}


def test_an_existing_file_is_refused(recorder: Recorder, tmp_path: Path) -> None:
    (tmp_path / "a.mcap").write_bytes(b"mine")
    assert "exists already" in opened(recorder, tmp_path / "a.mcap")["refused"]
    assert not recorder.recording
    assert (tmp_path / "a.mcap").read_bytes() == b"mine"


def test_a_command_that_makes_no_sense_is_refused(recorder: Recorder) -> None:
    assert closed(recorder)["refused"] == "nothing is being recorded; open a recording first"
    stranger = recorder.handle(Received(3, Answer(to=1)))
    assert stranger == Answer(to=3, refused="this is no command of a recorder")


def test_quitting_finishes_the_open_recording(ring: RingWriter, recorder: Recorder, tmp_path: Path) -> None:
    opened(recorder, tmp_path / "a.mcap")
    put_force(ring, 0)
    assert recorder.handle(Received(3, Quit())) == Answer(to=3)
    recording = read_recording(tmp_path / "a.mcap")
    assert (recording.complete, recording.metadata["summary"]["outcome"]) == (True, "recorder told to quit")
