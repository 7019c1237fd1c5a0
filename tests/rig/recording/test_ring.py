"""The ring: order, fullness, drops, a reader that dies, what is refused."""

import contextlib
import mmap
from collections.abc import Iterator
from pathlib import Path

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from rig.errors import DeviceError, UsageError
from rig.recording.ring import PAGE, RingReader, RingWriter, new_path
from rig.recording.slots import BODY_LIMIT, SLOT
from tests.rig.recording.conftest import drained


@pytest.fixture
def writer(tmp_path: Path) -> Iterator[RingWriter]:
    ring = RingWriter.create(tmp_path / "ring", slots=8)
    yield ring
    ring.close()


@pytest.fixture
def reader(writer: RingWriter) -> Iterator[RingReader]:
    ring = RingReader.open(writer.path)
    yield ring
    ring.close()


def test_samples_come_out_in_the_order_they_went_in(writer: RingWriter, reader: RingReader) -> None:
    writer.put(1, b"one")
    writer.put(5, b"")
    assert drained(reader, 10) == [(0, 1, b"one"), (1, 5, b"")]
    assert drained(reader, 10) == []
    assert (writer.head, reader.head, writer.fill) == (2, 2, 0.0)


def test_drain_stops_at_its_limit(writer: RingWriter, reader: RingReader) -> None:
    for number in range(5):
        writer.put(1, bytes([number]))
    assert [body for _, _, body in drained(reader, 3)] == [b"\0", b"\1", b"\2"]
    assert [body for _, _, body in drained(reader, 3)] == [b"\3", b"\4"]


def test_the_layout_in_the_file_is_the_documented_one(writer: RingWriter) -> None:
    writer.put(3, b"body")
    data = writer.path.read_bytes()
    assert len(data) == PAGE + 8 * SLOT
    assert data[:16] == b"tissring" + (8).to_bytes(8, "little")
    assert data[64:72] == (1).to_bytes(8, "little")
    slot = data[PAGE : PAGE + SLOT]
    assert slot[:4] == b"body"
    assert slot[244:] == (0).to_bytes(8, "little") + b"\x03\x00" + b"\x04\x00"


def test_a_full_ring_keeps_what_is_unread_and_counts_what_it_drops(writer: RingWriter, reader: RingReader) -> None:
    for number in range(11):
        writer.put(1 + number % 2, bytes([number]))
    assert writer.fill == 1.0
    assert writer.dropped == reader.dropped == {1: 2, 2: 1}
    assert [body[0] for _, _, body in drained(reader, 100)] == list(range(8))
    writer.put(1, b"after")
    assert drained(reader, 100) == [(8, 1, b"after")]


def test_an_uncommitted_batch_is_read_again_by_the_next_reader(writer: RingWriter) -> None:
    for number in range(4):
        writer.put(1, bytes([number]))
    first = RingReader.open(writer.path)
    drained(first, 2)
    drained(first, 2, commit=False)
    first.close()
    second = RingReader.open(writer.path)
    assert [number for number, _, _ in drained(second, 10)] == [2, 3]
    second.close()


def test_uncommitted_slots_are_not_overwritten(writer: RingWriter, reader: RingReader) -> None:
    for number in range(8):
        writer.put(1, bytes([number]))
    assert len(drained(reader, 8, commit=False)) == 8
    writer.put(1, b"no room")
    assert writer.dropped == {1: 1}
    reader.commit()
    writer.put(1, b"room")
    assert [body for _, _, body in drained(reader, 8)] == [b"room"]


def test_the_reader_leaves_a_sign_of_life(writer: RingWriter, reader: RingReader) -> None:
    assert writer.reader_age_ns(5_000) == 5_000
    reader.touch(4_000)
    assert writer.reader_age_ns(5_000) == 1_000


def test_what_was_published_outlives_the_producer(tmp_path: Path) -> None:
    writer = RingWriter.create(tmp_path / "ring", slots=8)
    writer.put(2, b"kept")
    writer.close(unlink=False)
    reader = RingReader.open(tmp_path / "ring")
    assert drained(reader, 10) == [(0, 2, b"kept")]
    reader.close()


def test_an_attached_reader_keeps_the_ring_that_its_producer_removed(tmp_path: Path) -> None:
    writer = RingWriter.create(tmp_path / "ring", slots=8)
    reader = RingReader.open(writer.path)
    writer.put(2, b"kept")
    writer.close(unlink=True)
    assert not (tmp_path / "ring").exists()
    assert drained(reader, 10) == [(0, 2, b"kept")]
    reader.close()


def test_a_slot_without_its_own_number_is_left_out_and_counted(writer: RingWriter, reader: RingReader) -> None:
    for number in range(3):
        writer.put(1, bytes([number]))
    with writer.path.open("r+b") as file, mmap.mmap(file.fileno(), 0) as raw:
        raw[PAGE + SLOT + BODY_LIMIT : PAGE + SLOT + BODY_LIMIT + 8] = b"\xff" * 8
    assert [body for _, _, body in drained(reader, 10)] == [b"\0", b"\2"]
    assert reader.damaged == 1


def test_a_body_larger_than_a_slot_is_refused(writer: RingWriter, reader: RingReader) -> None:
    writer.put(1, b"x" * BODY_LIMIT)
    with pytest.raises(ValueError, match="244 bytes"):
        writer.put(1, b"x" * (BODY_LIMIT + 1))
    assert [len(body) for _, _, body in drained(reader, 10)] == [BODY_LIMIT]


def test_a_stream_without_a_counter_is_refused(writer: RingWriter) -> None:
    with pytest.raises(ValueError, match=r"streams 0\.\.63"):
        writer.put(64, b"")


def test_a_number_of_slots_that_is_no_power_of_two_is_refused(tmp_path: Path) -> None:
    with pytest.raises(ValueError, match="power of two"):
        RingWriter.create(tmp_path / "ring", slots=100)


def test_a_second_reader_is_refused(writer: RingWriter, reader: RingReader) -> None:
    with pytest.raises(UsageError, match="another recorder"):
        RingReader.open(writer.path)


def test_a_ring_that_exists_is_not_overwritten(writer: RingWriter) -> None:
    with pytest.raises(DeviceError, match="cannot be created"):
        RingWriter.create(writer.path)


def test_a_ring_larger_than_the_memory_is_refused_and_leaves_nothing(tmp_path: Path) -> None:
    with pytest.raises(DeviceError, match="no room for a ring"):
        RingWriter.create(tmp_path / "ring", slots=1 << 45)
    assert not (tmp_path / "ring").exists()


@pytest.mark.parametrize("content", [b"", b"tissring", b"x" * 10_000, b"tissring" + b"\x08" + b"\0" * 9000])
def test_a_file_that_is_no_ring_is_refused(tmp_path: Path, content: bytes) -> None:
    (tmp_path / "other").write_bytes(content)
    with pytest.raises(UsageError, match="not a ring"):
        RingReader.open(tmp_path / "other")


def test_a_missing_ring_is_one_sentence(tmp_path: Path) -> None:
    with pytest.raises(UsageError, match="start the loop first"):
        RingReader.open(tmp_path / "none")


def test_opening_and_closing_leaves_no_descriptor_behind(tmp_path: Path) -> None:
    writer = RingWriter.create(tmp_path / "ring", slots=8)
    reader = RingReader.open(writer.path)
    for end in (reader, writer, reader, writer):
        end.close()
    assert [path for path in _open_files() if path.is_relative_to(tmp_path)] == []


def _open_files() -> list[Path]:
    """What this process has open; others of its threads may open and close files meanwhile."""
    found = []
    for descriptor in Path("/proc/self/fd").iterdir():
        with contextlib.suppress(OSError):
            found.append(descriptor.readlink())
    return found


def test_new_paths_differ() -> None:
    assert new_path() != new_path()


@settings(max_examples=50)
@given(st.lists(st.tuples(st.booleans(), st.integers(0, 63), st.binary(max_size=BODY_LIMIT)), max_size=60))
def test_whatever_is_put_is_read_or_counted(
    tmp_path_factory: pytest.TempPathFactory, steps: list[tuple[bool, int, bytes]]
) -> None:
    writer = RingWriter.create(tmp_path_factory.mktemp("ring") / "ring", slots=4)
    reader = RingReader.open(writer.path)
    read: list[tuple[int, bytes]] = []
    for drain, stream_id, body in steps:
        writer.put(stream_id, body)
        read += [(stream, data) for _, stream, data in drained(reader, 2)] if drain else []
    read += [(stream, data) for _, stream, data in drained(reader, 100)]
    put = iter([(stream, body) for _, stream, body in steps])
    assert all(item in put for item in read), "a subsequence, in order"
    assert len(read) + sum(reader.dropped.values()) == len(steps)
    reader.close()
    writer.close()
