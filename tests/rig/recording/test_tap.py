"""A look into the ring beside its reader: nothing is disturbed, nothing torn is shown, what was missed is counted."""

import mmap
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from rig.channels import EVENT, FORCE, EventSample, ForceSample
from rig.errors import UsageError
from rig.recording.ring import PAGE, RingReader, RingWriter
from rig.recording.slots import SLOT, rows_of, texts_of
from rig.recording.tap import RingTap
from tests.rig.recording.conftest import drained


@pytest.fixture
def writer(tmp_path: Path) -> Iterator[RingWriter]:
    ring = RingWriter.create(tmp_path / "ring", slots=8)
    yield ring
    ring.close()


def numbers(tap: RingTap, limit: int = 100) -> list[int]:
    return [int(slot["body"][0]) for slot in tap.take(limit)]


def publish(ring: RingWriter, reader: RingReader, values: range) -> None:
    for value in values:
        ring.put(1, bytes([value]))
        drained(reader, 1)


def test_reader_and_tap_see_the_same_and_neither_takes_from_the_other(writer: RingWriter) -> None:
    reader, tap = RingReader.open(writer.path), RingTap.open(writer.path)
    for value in range(5):
        writer.put(1, bytes([value]))
    assert numbers(tap, 2) == [0, 1]
    assert [body[0] for _, _, body in drained(reader, 9)] == [0, 1, 2, 3, 4]
    assert numbers(tap) == [2, 3, 4]
    assert (numbers(tap), tap.missed, reader.tail) == ([], 0, 5)
    before = writer.path.read_bytes()
    tap.put_back(2)
    assert numbers(tap) == [3, 4]
    assert writer.path.read_bytes() == before
    tap.close()
    reader.close()


def test_who_looks_too_late_is_told_how_much_was_missed(writer: RingWriter) -> None:
    reader, tap = RingReader.open(writer.path), RingTap.open(writer.path)
    publish(writer, reader, range(20))
    assert numbers(tap) == [13, 14, 15, 16, 17, 18, 19]  # the eighth is where the producer writes next
    assert tap.missed == 13
    late = RingTap.open(writer.path)
    assert (numbers(late)[0], late.missed) == (13, 0)
    for one in (tap, late, reader):
        one.close()


def test_what_is_overwritten_while_it_is_copied_is_not_shown(
    writer: RingWriter, monkeypatch: pytest.MonkeyPatch
) -> None:
    reader, tap = RingReader.open(writer.path), RingTap.open(writer.path)
    publish(writer, reader, range(7))
    heads = iter([7, 10])
    monkeypatch.setattr(RingTap, "head", property(lambda _: next(heads)))
    assert numbers(tap) == [3, 4, 5, 6]
    assert tap.missed == 3
    # Planted: without the second look at the head, torn slots would have passed.
    monkeypatch.setattr(RingTap, "head", property(lambda _: 7))
    tap.put_back(7)
    assert numbers(tap) == [0, 1, 2, 3, 4, 5, 6]
    tap.close()
    reader.close()


@given(st.lists(st.tuples(st.integers(0, 7), st.integers(1, 9)), max_size=30))
@settings(max_examples=60, deadline=None)
def test_taken_and_missed_are_all_there_were(
    tmp_path_factory: pytest.TempPathFactory, turns: list[tuple[int, int]]
) -> None:
    ring = RingWriter.create(tmp_path_factory.mktemp("ring") / "ring", slots=8)
    reader, tap, seen = RingReader.open(ring.path), RingTap.open(ring.path), list[int]()
    published = 0
    for count, limit in turns:
        publish(ring, reader, range(published, published + count))
        published += count
        seen += numbers(tap, limit)
    while found := numbers(tap):
        seen += found
    assert seen == sorted(set(seen)) and len(seen) + tap.missed == published
    for one in (tap, reader, ring):
        one.close()


def test_rows_come_out_as_tables_and_texts_as_rows(tmp_path: Path) -> None:
    ring = RingWriter.create(tmp_path / "ring", slots=16)
    tap = RingTap.open(ring.path)
    sample = ForceSample(3, 10, 11, 12, 1.0, 2.0, -3.0, 0.1, 0.2, 0.3, 25.0, 0, 1)
    event = EventSample(0, 10, 10, 20, "limit", "tiefer als erlaubt: 15 mm")
    ring.put(FORCE.id, FORCE.pack(sample))
    ring.put(EVENT.id, EVENT.pack(event))
    ring.put(FORCE.id, b"cut short")
    ring.put(EVENT.id, b"cut short")
    slots = tap.take(9)
    [row] = rows_of(slots, FORCE)
    assert tuple(row) == sample
    assert list(texts_of(slots, EVENT)) == [event]
    tap.close()
    ring.close()


def test_the_ring_cannot_be_written_through_it(writer: RingWriter) -> None:
    tap = RingTap.open(writer.path)
    assert isinstance(tap._data, mmap.mmap) and not np.frombuffer(tap._data, np.uint8, SLOT, PAGE).flags.writeable
    with pytest.raises(TypeError):
        tap._data[0] = 1


def test_what_is_no_ring_is_refused(tmp_path: Path) -> None:
    (tmp_path / "text").write_text("no ring at all")
    for name, said in (("text", "not a ring"), ("nothing", "start the loop")):
        with pytest.raises(UsageError, match=said):
            RingTap.open(tmp_path / name)
