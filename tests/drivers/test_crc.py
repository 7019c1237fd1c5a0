from hypothesis import given
from hypothesis import strategies as st

from drivers.crc import crc16_arc, crc16_modbus, crc16_x25, modbus_starts

DIGITS = b"123456789"


def makers_x25(data: bytes) -> int:
    """The byte update of the Bota driver (`crcCcittUpdate`), from which ours must not differ."""
    crc = 0xFFFF
    for byte in data:
        value = byte ^ (crc & 0xFF)
        value = (value ^ value << 4) & 0xFF
        crc = ((value << 8 | crc >> 8) ^ value >> 4 ^ value << 3) & 0xFFFF
    return crc ^ 0xFFFF


def bit_by_bit(data: bytes, crc: int) -> int:
    """The loop printed in the Modbus serial line guide, 6.2.2, with polynomial 0xA001."""
    for byte in data:
        crc ^= byte
        for _ in range(8):
            crc = crc >> 1 ^ (0xA001 if crc & 1 else 0)
    return crc


def test_the_check_values_of_the_crc_catalogue() -> None:
    assert crc16_x25(DIGITS) == 0x906E
    assert crc16_modbus(DIGITS) == 0x4B37
    assert crc16_arc(DIGITS) == 0xBB3D


def test_checksums_of_nothing() -> None:
    assert (crc16_x25(b""), crc16_modbus(b""), crc16_arc(b"")) == (0, 0xFFFF, 0)


@given(st.binary(max_size=300))
def test_x25_agrees_with_the_makers_loop(data: bytes) -> None:
    assert crc16_x25(data) == makers_x25(data)


@given(st.binary(max_size=300))
def test_modbus_and_arc_agree_with_the_loop_bit_by_bit(data: bytes) -> None:
    assert crc16_modbus(data) == bit_by_bit(data, 0xFFFF)
    assert crc16_arc(data) == bit_by_bit(data, 0)


@given(st.binary(max_size=300))
def test_modbus_and_arc_leave_no_residue_behind_their_own_checksum(data: bytes) -> None:
    assert crc16_modbus(data + crc16_modbus(data).to_bytes(2, "little")) == 0
    assert crc16_arc(data + crc16_arc(data).to_bytes(2, "little")) == 0


@given(st.binary(max_size=40), st.binary(min_size=2, max_size=40))
def test_where_a_checksum_begins_is_found_backwards_from_its_end(before: bytes, part: bytes) -> None:
    data = before + part + bit_by_bit(part, 0xFFFF).to_bytes(2, "little")
    begins = [at for at in range(len(data) - 3) if bit_by_bit(data[at:], 0xFFFF) == 0]
    assert len(before) in begins and list(modbus_starts(data)) == begins[::-1]
