"""Streams of the maker's own library on this computer: times against a planted shift, and what is refused."""

import importlib
import itertools
import os
import time
from collections.abc import Iterator
from types import ModuleType
from typing import Any

import pytest

from drivers.lsl import library
from drivers.lsl.device import LslInlet, open_stream
from drivers.lsl.library import ClockCorrection, load
from drivers.lsl.puller import Pulled, Puller
from mock_devices.lsl.mock import BreathingMock
from rig.config.products.lsl_stream import LslStream
from rig.errors import DeviceError, UsageError
from rig.input_streams import InputSample

pytestmark = [pytest.mark.bench, pytest.mark.xdist_group("lsl")]
NAMES = (f"belt-{os.getpid()}-{number}" for number in itertools.count())
MS = 1_000_000


@pytest.fixture
def pylsl() -> ModuleType:
    return load("machine")


@pytest.fixture
def belt() -> Iterator[BreathingMock]:
    mock = BreathingMock(next(NAMES), lambda: 20.0, time.monotonic_ns())
    yield mock
    mock.close()


def opened(port: str, **more: object) -> LslInlet:
    inlet = open_stream(LslStream.model_validate({"port": port} | more))
    inlet.start()
    return inlet


def played(belt: BreathingMock, inlet: LslInlet, seconds: float) -> list[InputSample]:
    found: list[InputSample] = []
    end_s = time.monotonic() + seconds
    while time.monotonic() < end_s:
        belt.tick(time.monotonic_ns())
        found += inlet.poll(time.monotonic_ns())
        time.sleep(0.002)
    return found


def delay_ms(samples: list[InputSample]) -> float:
    delays = sorted(sample.arrival_ns - sample.capture_ns for sample in samples)
    return delays[len(delays) // 2] / MS


def test_a_belt_comes_with_its_times_and_a_planted_shift_is_seen(belt: BreathingMock) -> None:
    inlet = opened(belt.endpoints()["lsl"])
    sound = played(belt, inlet, 0.6)
    assert len(sound) >= 20 and {sample.values for sample in sound} == {(20.0,)}
    assert [sample.seq for sample in sound] == list(range(len(sound)))
    assert 0 <= delay_ms(sound) < 20
    assert 0 <= sound[-1].uncertainty_ns < 5 * MS
    # 0.25 s older than they are: the clocks are right, the stamps are not.
    belt.shift_s = -0.25
    time.sleep(0.3)
    inlet.poll(time.monotonic_ns())
    assert delay_ms(played(belt, inlet, 0.6)[-10:]) == pytest.approx(250, abs=20)
    assert inlet.concern() == ""
    belt.shift_s = 1e6  # as if by the time of day
    foreign = played(belt, inlet, 0.3)
    assert foreign[-1].uncertainty_ns == -1
    assert "carry no time of the LSL clock" in inlet.concern()
    inlet.close()
    inlet.close()


def test_the_correction_of_the_library_goes_into_capture(belt: BreathingMock) -> None:
    """A sender whose clock is known to lag by 0.1 s, as the library would say of another computer."""

    def lagging(pylsl: ModuleType, inlet: Any, timeout_s: float) -> ClockCorrection:
        return ClockCorrection(library.correction(pylsl, inlet, timeout_s).offset_s - 0.1, 0.002)

    inlet = LslInlet(LslStream(port=belt.endpoints()["lsl"]), lagging)
    inlet.start()
    found = played(belt, inlet, 0.4)
    assert delay_ms(found) == pytest.approx(100, abs=20)
    assert found[-1].uncertainty_ns == 2 * MS
    inlet.close()


def test_a_silent_belt_is_lost_by_name(belt: BreathingMock) -> None:
    inlet = opened(belt.endpoints()["lsl"], silent_s=0.2)
    played(belt, inlet, 0.1)
    belt.silent = True
    with pytest.raises(DeviceError, match=r"stream 'belt.*no sample for 0\.\d s \(silent_s 0.2\)"):
        played(belt, inlet, 2.0)
    inlet.close()


def test_a_belt_that_goes_away_is_lost(belt: BreathingMock) -> None:
    inlet = opened(belt.endpoints()["lsl"], silent_s=30.0)
    played(belt, inlet, 0.1)
    belt.close()
    with pytest.raises(DeviceError, match="the stream is lost"):
        played(belt, inlet, 5.0)
    inlet.close()


@pytest.mark.parametrize(
    ("about", "sentence"),
    [
        ({"units": {"a": "1", "b": "1"}}, "has 1 channels, units names 2"),
        ({"units": {"respiration": "N"}}, "gives respiration in 'mm', units says 'N'"),
        ({"rate_Hz": 100.0}, "states 50 Hz, rate_Hz says 100"),
        ({"rate_Hz": 0.0}, "states 50 Hz, rate_Hz says 0"),
        ({"source_id": "other"}, "is not there .*; of that name there are 'tissue-rig-mock-belt' on"),
    ],
)
def test_what_does_not_fit_the_table_is_refused(belt: BreathingMock, about: dict[str, object], sentence: str) -> None:
    with pytest.raises(DeviceError, match=sentence):
        opened(belt.endpoints()["lsl"], **about)


def test_no_stream_of_that_name() -> None:
    with pytest.raises(DeviceError, match=r"stream 'nobody': is not there \(scope machine\); start its program"):
        opened("nobody")


def test_two_of_one_name_are_told_apart_by_their_source(pylsl: ModuleType) -> None:
    name = next(NAMES)
    outlets = [pylsl.StreamOutlet(pylsl.StreamInfo(name, "Gaze", 1, 50.0, pylsl.cf_float32, who)) for who in "ab"]
    with pytest.raises(DeviceError, match=r"2 have that name \('a' on .*, 'b' on .*\); give one by its source_id"):
        opened(name)
    inlet = opened(name, source_id="b")
    assert inlet.identity.serial == "b"
    inlet.close()
    del outlets


def test_irregular_samples_and_text(pylsl: ModuleType) -> None:
    name, words = next(NAMES), next(NAMES)
    beats = pylsl.StreamOutlet(pylsl.StreamInfo(name, "Heart", 1, 0.0, pylsl.cf_double64, "h"))
    text = pylsl.StreamOutlet(pylsl.StreamInfo(words, "Markers", 1, 0.0, pylsl.cf_string, "w"))
    with pytest.raises(DeviceError, match="carries text; an input takes numbers"):
        opened(words, rate_Hz=0.0)
    inlet = opened(name, rate_Hz=0.0, units={"heart_rate_per_min": "1/min"}, silent_s=0.1)
    assert inlet.period_ns == 0
    time.sleep(0.3)
    assert inlet.poll(time.monotonic_ns()) == []  # nothing comes, and nothing is wrong
    beats.push_sample([61.5])
    end_s, found = time.monotonic() + 5.0, list[InputSample]()
    while not found and time.monotonic() < end_s:
        found += inlet.poll(time.monotonic_ns())
    assert [sample.values for sample in found] == [(61.5,)]
    inlet.close()
    del beats, text


def test_without_the_extra_one_sentence_says_how_to_get_it(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(library, "_loaded", {})
    monkeypatch.setattr(library, "import_module", lambda _: importlib.import_module("no_such_library_here"))
    with pytest.raises(UsageError, match=r"needs an extra: pip install 'tissue-rig\[lsl\]'"):
        opened("belt")


def test_one_program_has_one_scope(pylsl: ModuleType) -> None:
    assert load("machine") is pylsl
    with pytest.raises(UsageError, match="input scope site: another input has scope machine"):
        load("site")
    assert "ResolveScope = machine" in library.configuration("machine")
    assert "IPv6 = disable" in library.configuration("machine")


class Ended:
    """As a library whose stream is gone after one sample."""

    def __init__(self) -> None:
        self.left = 1

    def pull_sample(self, timeout: float) -> tuple[list[float] | None, float]:
        assert 0 < timeout < 1
        self.left -= 1
        if self.left < -1:
            raise RuntimeError("gone")
        return ([1.0], 2.5) if self.left == 0 else (None, 0.0)


def test_a_sample_then_the_clock_then_the_end(pylsl: ModuleType, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("drivers.lsl.puller.CORRECT_EVERY_S", 0.0)
    known = ClockCorrection(0.1, 0.002)
    puller = Puller(pylsl, Ended(), lambda *_: known)
    assert puller.read() == [Pulled((1.0,), 2.5), known]
    assert puller.read() == [known]
    with pytest.raises(DeviceError, match="the stream is lost: gone; start its program again"):
        puller.read()


def test_the_librarys_sockets_are_given_back(belt: BreathingMock) -> None:
    """A stream that is lost and found again for a night must not use up what a process may open."""
    opened(belt.endpoints()["lsl"]).close()  # the library opens some for good with the first
    before = len(os.listdir("/proc/self/fd"))  # noqa: PTH208 - numbers, not paths
    held = [opened(belt.endpoints()["lsl"]) for _ in range(3)]
    for inlet in held:
        inlet.close()
    assert len(os.listdir("/proc/self/fd")) <= before  # noqa: PTH208
