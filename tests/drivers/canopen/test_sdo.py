"""SDO transfers byte by byte as CiA 301 draws them, and against a server with objects of every length."""

import pytest
from hypothesis import given
from hypothesis import strategies as st

from drivers.canopen.sdo import Download, Transfer, Upload
from mock_devices.canopen.sdo_server import SdoServer


def bytes_of(text: str) -> bytes:
    return bytes.fromhex(text)


@pytest.mark.parametrize(
    ("answer", "data"),
    [
        ("43 18 10 01 FB 00 00 00", "FB 00 00 00"),
        ("4B 41 60 00 37 02 00 00", "37 02"),
        ("4F 61 60 00 08 00 00 00", "08"),
        ("47 00 20 00 01 02 03 00", "01 02 03"),
        ("42 18 10 01 FB 00 00 00", "FB 00 00 00"),
    ],
)
def test_an_expedited_upload_ends_with_its_first_answer(answer: str, data: str) -> None:
    first = bytes_of(answer)
    upload = Upload(first[2] << 8 | first[1], first[3])
    assert upload.request == bytes((0x40,)) + first[1:4] + bytes(4)
    assert upload.feed(first) is False
    assert upload.done
    assert upload.data == bytes_of(data)


def test_a_segmented_upload_alternates_its_toggle_bit() -> None:
    upload = Upload(0x1008, 0)
    assert upload.feed(bytes_of("41 08 10 00 0A 00 00 00"))
    assert upload.request == bytes_of("60 00 00 00 00 00 00 00")
    assert upload.feed(b"\x00EPOS4 M")
    assert upload.request == bytes_of("70 00 00 00 00 00 00 00")
    assert upload.feed(b"\x19odu\0\0\0\0") is False
    assert upload.done
    assert upload.data == b"EPOS4 Modu"[: len(upload.data)]
    assert upload.data == b"EPOS4 Modu"


@pytest.mark.parametrize(
    ("data", "request_bytes"),
    [
        ("0F 00", "2B 40 60 00 0F 00 00 00"),
        ("08", "2F 40 60 00 08 00 00 00"),
        ("F4 01 7F 00", "23 40 60 00 F4 01 7F 00"),
        ("01 02 03", "27 40 60 00 01 02 03 00"),
    ],
)
def test_an_expedited_download_is_one_exchange(data: str, request_bytes: str) -> None:
    download = Download(0x6040, 0, bytes_of(data))
    assert download.request == bytes_of(request_bytes)
    assert download.feed(bytes_of("60 40 60 00 00 00 00 00")) is False
    assert download.done


def test_a_segmented_download_says_its_length_first_and_marks_its_last_segment() -> None:
    download = Download(0x2100, 1, b"EPOS4 Modu")
    assert download.request == bytes_of("21 00 21 01 0A 00 00 00")
    assert download.feed(bytes_of("60 00 21 01 00 00 00 00"))
    assert download.request == b"\x00EPOS4 M"
    assert download.feed(bytes_of("20 00 00 00 00 00 00 00"))
    assert download.request == b"\x19odu\0\0\0\0"
    assert download.feed(bytes_of("30 00 00 00 00 00 00 00")) is False
    assert download.done


@pytest.mark.parametrize("transfer", [Upload(0x6099, 3), Download(0x6099, 3, b"\x01")])
def test_an_abort_ends_a_transfer_with_its_code(transfer: Transfer) -> None:
    assert transfer.feed(bytes_of("80 99 60 03 11 00 09 06")) is False
    assert transfer.abort == 0x06090011
    assert not transfer.done


def test_answers_to_another_object_are_ignored_and_counted() -> None:
    upload = Upload(0x6041, 0)
    assert upload.feed(bytes_of("60 40 60 00 00 00 00 00")) is False
    assert upload.feed(bytes_of("80 40 60 00 00 00 00 08")) is False
    assert upload.feed(b"\x4b\x41\x60") is False
    assert not upload.ended
    assert upload.ignored == 3
    upload.feed(bytes_of("4B 41 60 00 37 02 00 00"))
    assert upload.data == bytes_of("37 02")


def test_a_wrong_toggle_bit_is_answered_with_an_abort() -> None:
    upload = Upload(0x1008, 0)
    upload.feed(bytes_of("41 08 10 00 0A 00 00 00"))
    assert upload.feed(b"\x10EPOS4 M")
    assert upload.request == bytes_of("80 08 10 00 00 00 03 05")
    assert upload.abort == 0x05030000


def test_a_command_out_of_place_is_answered_with_an_abort() -> None:
    upload = Upload(0x1008, 0)
    assert upload.feed(bytes_of("60 08 10 00 00 00 00 00"))
    assert upload.abort == 0x05040001
    download = Download(0x1008, 0, b"12345")
    assert download.feed(bytes_of("43 08 10 00 00 00 00 00"))
    assert download.abort == 0x05040001


def test_a_segment_without_end_is_given_up() -> None:
    upload = Upload(0x1008, 0)
    upload.feed(bytes_of("41 08 10 00 00 00 00 00"))
    for number in range(1000):
        if not upload.feed(bytes(((number % 2) << 4,)) + b"1234567") or upload.ended:
            break
    assert upload.abort == 0x05040001


@given(answers=st.lists(st.binary(max_size=9), max_size=30))
def test_no_answer_whatever_raises(answers: list[bytes]) -> None:
    for transfer in (Upload(0x1008, 0), Download(0x1008, 0, b"123456789")):
        for answer in answers:
            transfer.feed(answer)


@given(data=st.binary(max_size=100))
def test_any_value_goes_there_and_back(data: bytes) -> None:
    stored: dict[tuple[int, int], bytes] = {}

    def write(index: int, sub: int, value: bytes) -> None:
        stored[index, sub] = value

    server = SdoServer(lambda index, sub: stored[index, sub], write)
    download = Download(0x2000, 7, data)
    while not download.ended:
        download.feed(server.answer(download.request))
    assert stored == {(0x2000, 7): data}
    upload = Upload(0x2000, 7)
    while not upload.ended:
        upload.feed(server.answer(upload.request))
    assert upload.data == data
