"""Reading back: finished files, every kind of prefix, zeroed and flipped blocks, files that are something else."""

import random
import zlib
from pathlib import Path

import numpy as np
import pytest
import zstandard
from hypothesis import given, settings
from hypothesis import strategies as st
from mcap.data_stream import RecordBuilder
from mcap.opcode import Opcode
from mcap.records import Chunk
from mcap.writer import Writer

from rig.channels import BY_ID, BY_NAME, EVENT, LOOP, STREAMS, EventSample, LoopSample
from rig.errors import DataError
from rig.recording import chunk
from rig.recording.chunk import RECORD
from rig.recording.mcap_file import RecordingWriter
from rig.recording.mcap_layout import MESSAGE_HEAD
from rig.recording.reader import Recording, read_recording
from rig.recording.ring import RingReader, RingWriter
from rig.recording.scan import scan
from rig.recording.slots import BODY_LIMIT
from tests.rig.recording.conftest import METADATA, WriteRecording, axis, drained, event, force

SEED = 20


def force_rows(recording: Recording) -> list[tuple[float, ...]]:
    return [row.item() for row in recording.tables["force"]]


def assert_rows_are_true(recording: Recording) -> None:
    """Every row and event that is there is one that was written, none twice, in order."""
    for name, make in (("force", force), ("axis", axis)):
        rows = [row.item() for row in recording.tables[name]]
        seqs = [row[0] for row in rows]
        assert rows == [make(seq) for seq in seqs]
        assert seqs == sorted(set(seqs))
    assert recording.events == tuple(event(item.seq) for item in recording.events)


def test_a_finished_recording_comes_back_whole(write_recording: WriteRecording) -> None:
    recording = read_recording(write_recording(rows=1000))
    assert force_rows(recording) == [force(seq) for seq in range(1000)]
    assert recording.tables["axis"]["position_mm"][500] == 5.0
    assert recording.events == tuple(event(seq) for seq in range(10))
    assert recording.metadata == {**METADATA, "summary": {"outcome": "done"}}
    assert (recording.complete, recording.damage, recording.cut) == (True, (), "")


def test_a_stream_without_samples_is_an_empty_table(write_recording: WriteRecording) -> None:
    marker = read_recording(write_recording(rows=10)).tables["marker"]
    assert marker.shape == (0,)
    assert marker.dtype.names is not None
    assert marker.dtype.names[5:8] == ("x_mm", "y_mm", "z_mm")


def test_a_recording_of_nothing_is_complete(write_recording: WriteRecording) -> None:
    recording = read_recording(write_recording(rows=0))
    assert recording.complete
    assert all(len(table) == 0 for table in recording.tables.values())


def test_tables_cannot_be_changed(write_recording: WriteRecording) -> None:
    table = read_recording(write_recording(rows=10)).tables["force"]
    with pytest.raises(ValueError, match="read-only"):
        table["fz_N"][0] = 1.0


def test_an_unfinished_recording_is_cut_but_not_damaged(write_recording: WriteRecording) -> None:
    recording = read_recording(write_recording(rows=1000, finish=False))
    assert len(recording.tables["force"]) == 1000
    assert (recording.complete, recording.damage) == (False, ())
    assert "without its footer" in recording.cut
    assert recording.metadata == METADATA


def test_a_prefix_cut_at_any_byte_opens_with_every_batch_before_the_cut(write_recording: WriteRecording) -> None:
    path = write_recording(rows=1000)
    data = path.read_bytes()
    pick = random.Random(SEED)
    seen = set()
    for size in [*range(600), *(pick.randrange(len(data)) for _ in range(300)), len(data) - 1]:
        path.write_bytes(data[:size])
        recording = read_recording(path)
        assert_rows_are_true(recording)
        assert (recording.complete, recording.damage) == (False, ()), size
        assert recording.cut, size
        rows = len(recording.tables["force"])
        assert rows % 100 == 0
        assert rows >= 100 * (sum(end <= size for end in batch_ends(data)))
        seen.add(rows)
    assert seen == set(range(0, 1001, 100)), "the cuts fell into every batch"


def batch_ends(data: bytes) -> list[int]:
    """Ends of the chunks, found by growing prefixes as the walk itself reports them."""
    ends = []
    at = data.index(b"\x04\0\0\0zstd")
    while at > 0:
        start = at - 37
        ends.append(start + 9 + int.from_bytes(data[start + 1 : start + 9], "little"))
        at = data.find(b"\x04\0\0\0zstd", ends[-1])
        if at - 37 < 0 or data[at - 37] != 6:
            break
    return ends


@pytest.mark.parametrize("size", [1, 16, 512, 4096, 9000])
@pytest.mark.parametrize("how", ["zeroed", "flipped"])
def test_a_bad_block_costs_its_chunks_is_named_and_gives_no_wrong_row(
    write_recording: WriteRecording, size: int, how: str
) -> None:
    path = write_recording(rows=1000)
    data = path.read_bytes()
    pick = random.Random(SEED + size)
    for _ in range(60):
        at = pick.randrange(len(data))
        block = bytes(size) if how == "zeroed" else bytes(value ^ 0xA5 for value in data[at : at + size])
        bad = (data[:at] + block + data[at + size :])[: len(data)]
        if bad == data:
            continue
        path.write_bytes(bad)
        recording = read_recording(path)
        assert_rows_are_true(recording)
        assert recording.damage or recording.cut
        largest_chunk = 3600
        assert len(recording.tables["force"]) >= 1000 - 100 * (2 + size // largest_chunk + 1)


def test_a_chunk_with_a_wrong_checksum_is_left_out_and_named(write_recording: WriteRecording) -> None:
    path = write_recording(rows=1000)
    data = bytearray(path.read_bytes())
    start, end = batch_ends(bytes(data))[3], batch_ends(bytes(data))[4]
    data[end - 40] ^= 0xFF
    path.write_bytes(data)
    recording = read_recording(path)
    assert [row[0] for row in force_rows(recording)] == [*range(400), *range(500, 1000)]
    (sentence,) = recording.damage
    first, last = (int(number) for number in sentence.split()[1].strip(":").split(".."))
    assert start <= first < end == last
    assert sentence.endswith("left out")


def test_a_changed_letter_in_the_metadata_is_found(write_recording: WriteRecording) -> None:
    path = write_recording(rows=10, finish=False)
    path.write_bytes(path.read_bytes().replace(b"speed_mm_s\x03\0\0\x005.0", b"speed_mm_s\x03\0\0\x007.0"))
    recording = read_recording(path)
    assert "trial" not in recording.metadata
    assert "metadata 'trial' with a wrong checksum" in recording.damage[0]


def test_rows_survive_the_loss_of_the_chunk_that_defines_the_streams(write_recording: WriteRecording) -> None:
    path = write_recording(rows=300)
    data = bytearray(path.read_bytes())
    data[: batch_ends(bytes(data))[0]] = bytes(batch_ends(bytes(data))[0])
    path.write_bytes(data)
    recording = read_recording(path)
    assert [row[0] for row in force_rows(recording)] == list(range(100, 300))
    assert_rows_are_true(recording)


def test_a_lying_size_does_not_take_all_memory(write_recording: WriteRecording) -> None:
    path = write_recording(rows=200)
    data = bytearray(path.read_bytes())
    at = data.index(b"\x04\0\0\0zstd") - 12
    data[at : at + 8] = (1 << 50).to_bytes(8, "little")
    path.write_bytes(data)
    recording = read_recording(path)
    assert len(recording.tables["force"]) == 100
    assert "wrong size" in recording.damage[0]


@given(st.binary(max_size=300))
def test_the_walk_never_raises_whatever_the_bytes(noise: bytes) -> None:
    for data in (noise, b"\x89MCAP0\r\n" + noise, b"\x89MCAP0\r\n" + noise + b"\x89MCAP0\r\n"):
        assert scan(data).chunks == []


@pytest.mark.parametrize("content", [b"PK\x03\x04 something else", b"time_s,force_N\n0,1\n"])
def test_a_file_of_another_kind_is_refused(tmp_path: Path, content: bytes) -> None:
    (tmp_path / "a.mcap").write_bytes(content)
    with pytest.raises(DataError, match=r"a\.mcap: not a recording"):
        read_recording(tmp_path / "a.mcap")


def test_a_missing_file_is_one_sentence(tmp_path: Path) -> None:
    with pytest.raises(DataError, match="no such recording"):
        read_recording(tmp_path / "a.mcap")


def test_a_folder_in_place_of_a_file_is_one_sentence(tmp_path: Path) -> None:
    with pytest.raises(DataError, match="cannot be read: Is a directory"):
        read_recording(tmp_path)


def foreign(path: Path, topic: str, schema: str, body: bytes = b"\0\1\0\0" + bytes(8)) -> Path:
    with path.open("wb") as file:
        writer = Writer(file)
        writer.start()
        number = writer.register_schema("a/msg/A", "ros2msg", schema.encode())
        channel = writer.register_channel(topic, "cdr", number)
        writer.add_message(channel, 0, body, 0)
        writer.finish()
    return path


def test_a_recording_with_other_fields_is_refused(tmp_path: Path) -> None:
    with pytest.raises(DataError, match="stream force has other fields"):
        read_recording(foreign(tmp_path / "a.mcap", "force", "int64 seq\n"))


def test_a_recording_whose_loop_called_a_cycle_a_slot_is_read(tmp_path: Path) -> None:
    old = LOOP.schema().replace("int64 cycle", "int64 slot")
    body = b"\0\1\0\0" + LOOP.pack(LoopSample(1, 2, 3, 7, *(0 for _ in LoopSample._fields[4:])))
    recording = read_recording(foreign(tmp_path / "a.mcap", "loop", old, body))
    assert recording.tables["loop"]["cycle"].tolist() == [7]


def test_messages_that_the_stock_writer_mixed_come_back_in_their_order(tmp_path: Path) -> None:
    random, made = np.random.default_rng(SEED), {"force": force, "axis": axis}
    names = random.choice(list(made), 300).tolist()
    with (tmp_path / "a.mcap").open("wb") as file:
        writer = Writer(file)
        writer.start()
        schemas = {name: writer.register_schema(name, "ros2msg", BY_NAME[name].schema().encode()) for name in made}
        channels = {name: writer.register_channel(name, "cdr", number) for name, number in schemas.items()}
        for number, name in enumerate(names):
            body = b"\0\1\0\0" + BY_NAME[name].pack(made[name](number))
            writer.add_message(channels[name], 0, body, 0)
        writer.finish()
    tables = read_recording(tmp_path / "a.mcap").tables
    for name, make in made.items():
        numbers = [number for number, of in enumerate(names) if of == name]
        assert [row.item() for row in tables[name]] == [make(number) for number in numbers]


def test_an_mcap_file_of_someone_else_is_refused(tmp_path: Path) -> None:
    with pytest.raises(DataError, match="no stream of this bench"):
        read_recording(foreign(tmp_path / "a.mcap", "/camera", "int64 seq\n"))


NUMBER = st.one_of(st.integers(-(2**63), 2**63 - 1))
TEXT = st.text(max_size=20)


@st.composite
def samples(draw: st.DrawFn) -> tuple[int, bytes]:
    """A row of any stream with any value its fields can hold."""
    stream = draw(st.sampled_from(STREAMS))
    kinds = {int: NUMBER, float: st.floats(), str: TEXT}
    return stream.id, stream.pack(tuple(draw(kinds[kind]) for kind in stream.kinds.values()))


@settings(max_examples=60)
@given(st.lists(st.tuples(samples(), st.booleans()), max_size=30))
def test_whatever_goes_into_the_ring_comes_out_of_the_file(
    tmp_path_factory: pytest.TempPathFactory, steps: list[tuple[tuple[int, bytes], bool]]
) -> None:
    folder = tmp_path_factory.mktemp("trip")
    ring = RingWriter.create(folder / "ring", slots=32)
    reader = RingReader.open(ring.path)
    writer = RecordingWriter(folder / "a.mcap", {})
    for (stream_id, body), flush in steps:
        assert len(body) <= BODY_LIMIT
        ring.put(stream_id, body)
        if flush:
            for _, number, data in drained(reader, 100):
                writer.add(number, data)
            writer.flush()
    for _, number, data in drained(reader, 100):
        writer.add(number, data)
    writer.finish({})
    reader.close()
    ring.close()
    recording = read_recording(folder / "a.mcap")
    for stream in STREAMS:
        bodies = [body for (stream_id, body), _ in steps if stream_id == stream.id]
        if stream is EVENT:
            assert [EVENT.pack(item) for item in recording.events] == bodies
            assert all(isinstance(item, EventSample) for item in recording.events)
        else:
            assert recording.tables[stream.name].tobytes() == b"".join(bodies)
            assert recording.tables[stream.name].dtype == BY_ID[stream.id].dtype
    assert recording.complete
    assert np.all([not recording.damage, not recording.cut])


@pytest.mark.parametrize("size", range(1, MESSAGE_HEAD.size - RECORD.size))
def test_a_chunk_that_ends_within_the_head_of_a_message_is_named(size: int) -> None:
    with pytest.raises(chunk.BadRecord):
        chunk.take_apart(_chunk_of(RECORD.pack(Opcode.MESSAGE, size) + bytes(size)))


def _chunk_of(data: bytes) -> bytes:
    packed = zstandard.ZstdCompressor().compress(data)
    builder = RecordBuilder()
    Chunk("zstd", packed, 1, 1, zlib.crc32(data), len(data)).write(builder)
    return bytes(builder.end())[RECORD.size :]
