"""The glove under known weights: a characteristic in closed form, and each mistake that a person makes."""

from collections.abc import Callable
from datetime import UTC, datetime

import pytest

from controller.commissioning.glove import FingerReading, calibrate, read
from controller.commissioning.weights import Weights
from drivers.roles import Identity, LinkCounters
from rig.config.glove import GloveCalibration
from rig.errors import CheckFailed, DeviceError
from rig.input_streams import InputSample

WEIGHTS = Weights((2.0, 5.0), 0.0)
FINGERS = ("thumb", "index")
WHO = Identity("firmata-glove", "", "Std 2.5")
NOW = datetime(2026, 1, 1, tzinfo=UTC)


class Hand:
    """Weights on fingers; each reads 40 counts and 50 more a newton, and ``wrong`` changes what lies where."""

    def __init__(self, wrong: Callable[[dict[str, float], int], dict[str, float]] = lambda counts, _: counts) -> None:
        self.loads = dict.fromkeys(FINGERS, 0.0)
        self.asked: list[tuple[str, float]] = []
        self._wrong = wrong

    def put_on(self, finger: str, load_N: float) -> None:
        self.asked.append((finger, load_N))
        self.loads[finger] = load_N

    def look(self) -> FingerReading:
        counts = {finger: 40.0 + 50.0 * load_N for finger, load_N in self.loads.items()}
        return FingerReading(self._wrong(counts, len(self.asked)), dict.fromkeys(FINGERS, 0.7))


def calibrated(hand: Hand, weights: Weights = WEIGHTS) -> GloveCalibration:
    return calibrate(WHO, FINGERS, weights, hand.put_on, hand.look, NOW)


def test_each_finger_under_each_weight_up_and_down() -> None:
    hand = Hand()
    found = calibrated(hand)
    assert hand.asked == [(finger, load_N) for finger in FINGERS for load_N in (0.0, 2.0, 5.0, 2.0, 0.0)]
    thumb = found.fingers["thumb"]
    assert (thumb.loads_N, thumb.counts) == ((0.0, 2.0, 5.0), (40.0, 140.0, 290.0))
    assert (thumb.noise_counts, thumb.repeatability, found.firmware) == (0.7, 0.0, "Std 2.5")
    assert GloveCalibration.model_validate_json(found.model_dump_json()) == found


def test_what_differs_between_up_and_down_is_kept_as_repeatability() -> None:
    found = calibrated(Hand(lambda counts, step: counts | {"thumb": counts["thumb"] + 25.0 * (step == 4)}))
    # 25 of 250 counts.
    assert found.fingers["thumb"].repeatability == pytest.approx(0.1)
    assert found.fingers["thumb"].counts[1] == 152.5


def swapped(counts: dict[str, float], _: int) -> dict[str, float]:
    return {"thumb": counts["index"], "index": counts["thumb"]}


@pytest.mark.parametrize(
    ("wrong", "sentence"),
    [
        (lambda counts, _: counts | {"thumb": 40.0}, r"thumb: its reading rose by 0 counts under 5 N .* wire and pin"),
        (swapped, r"thumb: the weight lay on index \(its reading rose by 250 counts\)"),
        (lambda counts, _: counts | {"thumb": 4 * counts["thumb"]}, r"thumb: its converter is at its end under 5 N"),
        (
            lambda counts, step: counts | {"thumb": counts["thumb"] + 60.0 * (step > 3)},
            r"thumb: its readings up and down differ by 27% of its range \(at most 15%\)",
        ),
        (
            lambda counts, step: counts | {"thumb": 30.0 if step in (2, 4) else counts["thumb"]},
            "thumb: its reading does not rise from weight to weight",
        ),
    ],
)
def test_each_mistake_has_its_sentence(
    wrong: Callable[[dict[str, float], int], dict[str, float]], sentence: str
) -> None:
    with pytest.raises(CheckFailed, match=sentence):
        calibrated(Hand(wrong))


class TimedGlove:
    """A sample every 20 ms of a clock that ``sleep`` moves on."""

    period_ns = 20_000_000
    identity = WHO

    def __init__(self, silent: bool = False) -> None:
        self.now_ns, self._seq, self._silent = 0, 0, silent
        self.counters, self.next_seq = LinkCounters(), 0

    def start(self) -> None: ...

    def fileno(self) -> int:
        return -1

    def concern(self) -> str:
        return ""

    def close(self) -> None: ...

    def poll(self, now_ns: int) -> list[InputSample]:
        found = []
        while not self._silent and (self._seq + 1) * self.period_ns <= now_ns:
            self._seq += 1
            at_ns = self._seq * self.period_ns
            values = (0.0, 0.0, float(self._seq), 7.0)
            found.append(InputSample(self._seq, at_ns, at_ns, 0, 0, 0, values, 0, 1))
        return found

    def sleep(self, seconds: float) -> None:
        self.now_ns += round(seconds * 1e9)


def test_a_reading_is_the_mean_of_the_samples_after_the_rest() -> None:
    glove = TimedGlove()
    found = read(glove, FINGERS, seconds=0.2, settle_s=0.1, now=lambda: glove.now_ns, sleep=glove.sleep)
    # Samples 5 to 14 lie in 0.1 to 0.3 s; their mean is 9.5 and their rms about it the root of 99 / 12.
    assert found.mean == {"thumb": 9.5, "index": 7.0}
    assert found.rms["thumb"] == pytest.approx((99 / 12) ** 0.5)


def test_a_silent_glove_is_named() -> None:
    glove = TimedGlove(silent=True)
    with pytest.raises(DeviceError, match="the glove gave 0 samples, 8 are needed"):
        read(glove, FINGERS, 0.2, 0.1, lambda: glove.now_ns, glove.sleep)
