"""``kill -9`` of recorder, loop and supervisor at random moments: what was published is in a file that opens."""

import os
import random
import signal
import struct
import subprocess
import sys
import time
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import numpy as np
import pytest

from rig.recording.client import RecorderClient
from rig.recording.mcap_file import RecordingFailed
from rig.recording.reader import Recording, read_recording
from rig.recording.ring import RingWriter, new_path
from tests.rig.recording.test_mcap_file import disk_of

pytestmark = [pytest.mark.bench, pytest.mark.xdist_group("wire")]

KILLS = 10
SEED = 1


@contextmanager
def producer(ring: Path, *more: str) -> Iterator["subprocess.Popen[bytes]"]:
    script = Path(__file__).with_name("producer.py")
    with subprocess.Popen([sys.executable, str(script), str(ring), *more], stdout=subprocess.PIPE) as process:
        try:
            assert process.stdout is not None
            assert process.stdout.readline() == b"running\n"
            yield process
        finally:
            process.kill()
            process.wait()
            ring.unlink(missing_ok=True)


class Header:
    """The ring's own account of itself, read behind the back of both ends; outlives the removal of the file."""

    def __init__(self, ring: Path) -> None:
        self._fd = os.open(ring, os.O_RDONLY)

    def head(self) -> int:
        return int(struct.unpack("<q", os.pread(self._fd, 8, 64))[0])

    def tail(self) -> int:
        return int(struct.unpack("<q", os.pread(self._fd, 8, 128))[0])

    def close(self) -> None:
        os.close(self._fd)


def true_rows(recording: Recording) -> "np.ndarray[tuple[int], np.dtype[np.int64]]":
    """Numbers of the rows, after checking that every row is as published and none is missing in between."""
    table = recording.tables["force"]
    seqs = table["seq"].astype(np.int64)
    assert (np.diff(seqs) == 1).all()
    assert (table["fz_N"] == seqs / 7).all()
    assert (table["device_us"] == seqs).all()
    assert not recording.damage
    return seqs


def test_a_killed_recorder_loses_at_most_its_last_batch_and_its_successor_has_that(tmp_path: Path) -> None:
    pick = random.Random(SEED)
    ring = new_path()
    following = 0
    with producer(ring):
        header = Header(ring)
        for number in range(KILLS):
            client = RecorderClient(ring, resume=True)
            path = tmp_path / f"{number}.mcap"
            client.open(path, {"recording": {"id": str(number)}})
            time.sleep(pick.uniform(0.0, 0.7))
            client.kill()
            recording = read_recording(path)
            seqs = true_rows(recording)
            assert recording.metadata == {"recording": {"id": str(number)}}
            assert not recording.complete
            assert seqs.size == 0 or seqs[0] == following, "it began where its predecessor had stopped"
            # One chunk may already be in the file when the recorder dies before it gives the slots back.
            assert (seqs[-1] + 1 if seqs.size else following) >= header.tail(), "what was given back is in the file"
            following = header.tail()
        with RecorderClient(ring, resume=True) as client:
            client.open(tmp_path / "last.mcap", {})
            reply = client.close({})
        header.close()
    seqs = true_rows(read_recording(tmp_path / "last.mcap"))
    assert seqs[0] == following > 0
    assert reply.samples == {"force": seqs.size}


def test_a_killed_loop_loses_nothing_it_had_published(tmp_path: Path) -> None:
    pick = random.Random(SEED)
    for number in range(KILLS):
        ring = new_path()
        with producer(ring) as process:
            header = Header(ring)
            with RecorderClient(ring, resume=True) as client:
                client.open(tmp_path / f"{number}.mcap", {})
                time.sleep(pick.uniform(0.0, 0.4))
                process.kill()
                process.wait()
                published = header.head()
                reply = client.close({"outcome": "loop lost"})
            header.close()
        seqs = true_rows(read_recording(tmp_path / f"{number}.mcap"))
        assert (seqs == np.arange(published)).all()
        assert reply.samples == {"force": published}
        assert reply.dropped == reply.missing == {}


def test_a_killed_supervisor_leaves_a_finished_recording_and_no_ring(tmp_path: Path) -> None:
    ring = new_path()
    path = tmp_path / "a.mcap"
    with producer(ring, str(path)) as process:
        header = Header(ring)
        time.sleep(random.Random(SEED).uniform(0.2, 0.5))
        process.kill()
        process.wait()
        published = header.head()
        deadline = time.monotonic() + 60
        while ring.exists() and time.monotonic() < deadline:
            time.sleep(0.05)
        header.close()
    recording = read_recording(path)
    seqs = true_rows(recording)
    assert recording.complete
    assert recording.metadata["summary"]["outcome"] == "supervisor lost"
    assert seqs[-1] == published - 1


@pytest.mark.parametrize("number", [signal.SIGHUP, signal.SIGTERM])
def test_a_recorder_that_is_told_to_end_leaves_a_finished_recording(tmp_path: Path, number: signal.Signals) -> None:
    ring = new_path()
    with producer(ring):
        client = RecorderClient(ring)
        client.open(tmp_path / "a.mcap", {})
        time.sleep(0.3)
        client._process.send_signal(number)
        assert client._process.wait(30) == 0
        client.quit()
    recording = read_recording(tmp_path / "a.mcap")
    assert recording.complete
    assert recording.metadata["summary"]["outcome"] == "recorder ended by a signal"
    assert true_rows(recording).size > 0


def test_a_dead_recorder_is_told_in_one_sentence(tmp_path: Path) -> None:
    ring = RingWriter.create(new_path(), slots=8)
    client = RecorderClient(ring.path)
    alive = [client.alive]
    assert client.failure == ""
    client.kill()
    alive.append(client.alive)
    assert alive == [True, False]
    with pytest.raises(RecordingFailed, match=r"recorder process ended \(exit code -9\)"):
        client.open(tmp_path / "a.mcap", {})
    client.quit()
    ring.close()


def test_a_recorder_without_a_ring_does_not_start(tmp_path: Path) -> None:
    with pytest.raises(RecordingFailed, match="no ring: No such file or directory; start the loop first"):
        RecorderClient(tmp_path / "none")


def test_a_full_disk_is_told_while_recording(tmp_path: Path) -> None:
    ring = new_path()
    with producer(ring):
        with disk_of(60_000):
            client = RecorderClient(ring)
        client.open(tmp_path / "a.mcap", {})
        deadline = time.monotonic() + 60
        while not client.failure and time.monotonic() < deadline:
            time.sleep(0.05)
        assert "File too large" in client.failure
        with pytest.raises(RecordingFailed, match="File too large"):
            client.close({})
        client.open(tmp_path / "b.mcap", {})
        assert client.failure == ""
        client.close({})
        client.quit()
    assert len(true_rows(read_recording(tmp_path / "a.mcap"))) > 0


def test_quitting_twice_is_harmless(tmp_path: Path) -> None:
    ring = RingWriter.create(new_path(), slots=8)
    client = RecorderClient(ring.path)
    client.quit()
    client.quit()
    assert client.failure.startswith("the recorder process ended (exit code 0)")
    ring.close()
