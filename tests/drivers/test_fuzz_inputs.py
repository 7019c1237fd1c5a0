"""A million random and mutated strings for each codec of an input: no crash, nothing without bound, and it goes on."""

import random

import pytest

from drivers.evdev.codec import EVENT, EventParser, KeyChange, event
from drivers.firmata.codec import LONGEST, FirmataParser, PinReading, reading, sampling_interval, sysex
from drivers.roles import LinkCounters

STRINGS = 1_000_000
SOUND = (reading(2, 421), sysex(0x79, b"\x02\x05S\x00"), sampling_interval(20), b"\xf9\x02\x05")


def strings(rng: random.Random, sound: tuple[bytes, ...], count: int) -> list[bytes]:
    """Half of them noise, half of them messages with one byte exchanged."""
    found = []
    for _ in range(count):
        if rng.random() < 0.5:
            found.append(rng.randbytes(rng.randrange(9)))
        else:
            text = bytearray(rng.choice(sound))
            text[rng.randrange(len(text))] = rng.randrange(256)
            found.append(bytes(text))
    return found


@pytest.mark.extra
@pytest.mark.timeout(300)
def test_firmata() -> None:
    rng, counters = random.Random(1), LinkCounters()
    parser = FirmataParser(counters)
    for _ in range(STRINGS // 10_000):
        for text in strings(rng, SOUND, 10_000):
            parser.feed(text)
        assert len(parser._held) <= LONGEST
    assert parser.feed(SOUND[0])[-1] == PinReading(2, 421)
    assert counters.frames > STRINGS / 10 and counters.discarded_bytes > STRINGS / 10


@pytest.mark.extra
@pytest.mark.timeout(300)
def test_input_events() -> None:
    rng, parser = random.Random(2), EventParser()
    sound = (event(10**18, 1, 48, 1), event(10**18, 4, 4, 7))
    for _ in range(STRINGS // 10_000):
        for text in strings(rng, sound, 10_000):
            parser.changes(text)
        assert len(parser._rest) < EVENT.size
    fresh = EventParser()
    assert fresh.changes(sound[0]) == [KeyChange(10**18, 48, True)]
