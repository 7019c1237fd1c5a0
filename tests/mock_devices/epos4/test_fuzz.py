"""Frames and bytes without sense against the drive mock."""

import struct

from hypothesis import given
from hypothesis import strategies as st

from drivers.can.slcan import CanFrame
from mock_devices.epos4.table import EPOS4
from mock_devices.testing.epos4 import DriveBench
from tests.mock_devices.epos4.wire import exchange, status, upload

OBJECTS = EPOS4.objects
FRAMES = st.tuples(
    st.sampled_from((0x000, 0x080, 0x201, 0x301, 0x401, 0x501, 0x601, 0x701, 0x77F)), st.binary(max_size=8)
)
ORDERS = st.sampled_from([b"\x01\x01", b"\x80\x01", b"\x81\x01", b"\x82\x00"]).map(lambda data: (0x000, data))
WRITES = st.builds(
    lambda key, value: (0x601, struct.pack("<BHBi", 0x23 | (4 - (OBJECTS[key].size or 4)) << 2, *key, value)),
    st.sampled_from(sorted(OBJECTS)),
    st.integers(-(1 << 31), (1 << 31) - 1),
)
WORDS = st.sampled_from([0x06, 0x07, 0x0F, 0x1F, 0x3F, 0x5F, 0x10F, 0x0B, 0x00, 0x80]).map(
    lambda word: (0x601, struct.pack("<BHBi", 0x2B, 0x6040, 0, word))
)
MODES = st.sampled_from([1, 3, 6, 8, 9, 10]).map(lambda mode: (0x601, struct.pack("<BHBi", 0x2F, 0x6060, 0, mode)))


@given(frames=st.lists(st.one_of(FRAMES, ORDERS, WRITES, WORDS, MODES), max_size=60))
def test_no_frames_whatever_break_the_drive_and_a_reset_makes_it_as_new(frames: list[tuple[int, bytes]]) -> None:
    bench = DriveBench()
    for can_id, data in frames:
        bench.send(CanFrame(can_id, data))
        bench.run(0.003)
    bench.run(0.06)
    bench.send(CanFrame(0x000, b"\x81\x01"))
    bench.run(0.06)
    assert status(bench) & 0x4F == 0x40
    assert upload(bench, 0x6064) == 0


@given(chunks=st.lists(st.binary(max_size=60), max_size=20))
def test_no_bytes_whatever_break_the_adapter(chunks: list[bytes]) -> None:
    bench = DriveBench()
    for chunk in chunks:
        bench.say(chunk)
    bench.say(b"\rC\rS8\rO\r")
    assert exchange(bench, b"\r") == b"\r"
