"""A force calibration on the simulated sensor: what comes out of a sound one, and each thing that is refused."""

from collections.abc import Callable
from datetime import UTC, datetime

import numpy as np
import pytest

from controller.commissioning.force import calibrate
from controller.commissioning.readings import FEWEST_SAMPLES, Reading, reading_of
from controller.commissioning.weights import Weights, parse_weights
from drivers.roles import Identity
from mock_devices.bench import Bench
from mock_devices.parameters import Parameters, Sensor
from rig.channels import ForceSample
from rig.config.calibration import ForceCalibration
from rig.config.products.bota_sensone import BotaWiring
from rig.errors import CheckFailed, DeviceError, UsageError

MS_NS = 1_000_000
SENSOR = Identity("BFT-SENS-SER-M8", "000271", "1.0.6")
WEIGHTS = Weights((2.0, 5.0, 10.0), uncertainty=0.0)
TODAY = datetime(2026, 3, 1, 9, 0, tzinfo=UTC)


class Person:
    """Puts weights on the tip of a simulated bench, and reads its sensor for 120 ms once it rests."""

    def __init__(self, bench: Bench) -> None:
        self.bench, self.now_ns, self.readings = bench, 0, 0
        self.put_on: Callable[[float], float] = lambda load_N: load_N

    def apply(self, load_N: float) -> None:
        self.bench.weight_N = self.put_on(load_N)
        self._pass(50)

    def read(self) -> Reading:
        self.readings += 1
        return reading_of([self._sample() for _ in range(120)], "bota-sensone")

    def _sample(self) -> ForceSample:
        self._pass(1)
        valid = int(not self.bench.force.overrange())
        return ForceSample(0, self.now_ns, self.now_ns, 0, *self.bench.force.wrench(), 25.0, 0, valid)

    def _pass(self, ms: int) -> None:
        self.now_ns += ms * MS_NS
        self.bench.advance(self.now_ns)


def person(**sensor: object) -> Person:
    return Person(Bench(Parameters(force=Sensor.model_validate(sensor)), seed=1))


def calibrated(hand: Person, config: BotaWiring | None = None, weights: Weights = WEIGHTS) -> ForceCalibration:
    return calibrate(SENSOR, config or BotaWiring(), weights, hand.apply, hand.read, TODAY)


def test_a_sound_sensor_gives_its_gain_crosstalk_zero_and_noise() -> None:
    found = calibrated(person(gain=1.01, crosstalk=0.02))
    assert (found.product, found.serial, found.date) == ("BFT-SENS-SER-M8", "000271", TODAY)
    # Readings are 1.01 of the load, and 2 % of that on the other two: the matrix is the inverse of that sensitivity.
    assert np.array(found.matrix) == pytest.approx(np.array([[1, 0, -0.02], [0, 1, -0.02], [0, 0, 1 / 1.01]]), abs=1e-3)
    assert found.zero_N == pytest.approx((0.21, -0.14, 0.8), abs=0.002)
    assert found.noise_N == pytest.approx((0.005, 0.005, 0.005), rel=0.2)
    assert [load.load_N for load in found.loads] == [0, 2, 5, 10, 5, 2, 0]


def test_calibrated_force_is_the_load_and_nothing_across() -> None:
    found = calibrated(person(gain=1.015, crosstalk=0.02))
    heaviest = max(found.loads, key=lambda load: load.load_N)
    change_N = [now - zero for now, zero in zip(heaviest.force_N, found.zero_N, strict=True)]
    assert found.map.compression_N(*change_N) == pytest.approx(10.0, abs=0.005)
    assert found.map.force_N(*change_N) == pytest.approx((0.0, 0.0, -10.0), abs=0.005)


def test_weights_that_hang_show_the_other_sign_and_give_the_same_calibration() -> None:
    hung = calibrated(person(), weights=Weights((-2.0, -5.0, -10.0), uncertainty=0.0))
    assert hung.compression == "negative"
    assert np.array(hung.matrix) == pytest.approx(np.array(calibrated(person()).matrix), abs=1e-3)


def test_uncertainty_is_that_of_noise_and_weights() -> None:
    found = calibrated(person(), weights=Weights((2.0, 5.0, 10.0), uncertainty=0.004)).uncertainty
    # Noise 5 mN, 120 samples: 0.46 mN a mean; sum of squares of (0 2 5 10 5 2 0) about its mean is 75.7 N2.
    assert found.repeatability == pytest.approx(0.005 / 120**0.5 / 75.7**0.5, rel=0.8)
    assert found.weights == 0.004
    assert found.combined == pytest.approx((found.repeatability**2 + 0.004**2 + found.linearity**2) ** 0.5)


@pytest.mark.parametrize(
    ("sensor", "sentence"),
    [
        ({"compression": "positive"}, "compression is positive on fz, and force.compression is negative"),
        ({"axis": "fx"}, r"2 N change fx most, by -2 N, and fz by -0.00.* N: force.axis is fz"),
        ({"gain": 0.5}, r"fz shows 0.500 N a newton \(limit 1 \+- 0.02\)"),
        ({"gain": 2.0}, r"fz shows 2.000 N a newton"),
        ({"gain": 1.03}, r"fz shows 1.030 N a newton"),
        ({"gain": 0.005}, r"2 N change no force channel by more than 0.01\d* N"),
        ({"gain": 0.0}, "change no force channel"),
        ({"crosstalk": 0.05}, r"fx shows 5.0 % of a load along fz \(limit 3 %\)"),
        ({"range_N": 7.0}, "saturated"),
    ],
)
def test_a_sensor_that_contradicts_the_configuration_is_refused(sensor: dict[str, object], sentence: str) -> None:
    with pytest.raises(CheckFailed, match=sentence):
        calibrated(person(**sensor))


@pytest.mark.parametrize("sensor", [{"compression": "positive"}, {"axis": "fx"}, {"gain": 0.0}])
def test_what_the_lightest_weight_shows_is_refused_before_the_next_is_asked_for(sensor: dict[str, object]) -> None:
    hand = person(**sensor)
    with pytest.raises(CheckFailed):
        calibrated(hand)
    assert hand.readings == 2


def test_a_channel_that_is_dead_beside_one_that_lives_is_refused() -> None:
    hand = person()
    hand.bench.force.channels.dead = 2
    with pytest.raises(CheckFailed, match="no force channel by more than"):
        calibrated(hand)


def test_a_zero_that_drifts_is_refused() -> None:
    hand = person()
    hand.bench.force.channels.drift(0.2, 0.0)
    with pytest.raises(CheckFailed, match=r"the zero of fz moved by -0.2\d* N between beginning and end"):
        calibrated(hand)


def test_a_weight_that_is_not_what_it_says_is_refused() -> None:
    hand = person()
    hand.put_on = lambda load_N: 5.5 if load_N == 5.0 else load_N
    with pytest.raises(CheckFailed, match=r"the reading under 5 N lies .* off a straight line"):
        calibrated(hand)


def test_a_weight_pushed_aside_is_refused() -> None:
    hand = person()

    def aside(load_N: float) -> float:
        hand.bench.force.lateral_N = 0.1 * load_N
        return load_N

    hand.put_on = aside
    with pytest.raises(CheckFailed, match=r"fx shows 9.6 % of a load along fz"):
        calibrated(hand)


def test_a_weight_that_swings_is_refused() -> None:
    hand = person()
    still = hand._sample

    def swinging() -> ForceSample:
        hand.bench.weight_N += 0.05 if hand.bench.weight_N else 0.0
        return still()

    hand._sample = swinging  # type: ignore[method-assign]
    with pytest.raises(CheckFailed, match=r"the reading under 2 N moves by 1.\d N rms \(limit 0.2 N\)"):
        calibrated(hand)


def test_a_sensor_without_a_status_is_saturated_at_the_end_of_its_range() -> None:
    samples = [ForceSample(0, 0, 0, 0, 0.0, 0.0, force_N, 0.0, 0.0, 0.0, 25.0, 0, 1) for force_N in (0.0, 300.0) * 8]
    with pytest.raises(CheckFailed, match=r"robotiq-ft300 is saturated, .*: 8 of 16 samples, largest 300.00 N"):
        reading_of(samples, "robotiq-ft300")


def test_a_silent_sensor_is_told() -> None:
    with pytest.raises(DeviceError, match=f"gave 0 samples, {FEWEST_SAMPLES} are needed"):
        reading_of([], "bota-sensone")


def parsed(text: str, hung: bool = False, tolerance: float = 0.0, gravity_m_s2: float | None = None) -> Weights:
    return parse_weights(text, hung, tolerance, 20.0, gravity_m_s2)


def test_weights_are_newtons_from_the_lightest_up() -> None:
    assert parsed("1 kg, 5N,100 g").loads_N == pytest.approx((0.980665, 5.0, 9.80665))
    assert parsed("1 N,2 N", hung=True).loads_N == (-1.0, -2.0)
    assert parsed("1 N,2 N,3 N").sequence_N == (0.0, 1.0, 2.0, 3.0, 2.0, 1.0, 0.0)
    assert parsed("1 kg,2 kg", gravity_m_s2=9.78).loads_N == pytest.approx((9.78, 19.56))


def test_what_nobody_knows_of_weights_is_their_uncertainty() -> None:
    assert parsed("1 N,2 N", tolerance=0.01).uncertainty == pytest.approx(0.01 / 3**0.5)
    # A mass where the place is unknown: gravity lies between 9.780 and 9.832 m/s2.
    assert parsed("0.5 kg,1 kg").uncertainty == pytest.approx(0.026 / 9.80665 / 3**0.5)
    assert parsed("0.5 kg,1 kg", gravity_m_s2=9.81).uncertainty == 0.0


@pytest.mark.parametrize(
    ("text", "sentence"),
    [
        ("five N", "'five N' is no weight"),
        ("1", "'1' is no weight; write numbers with g, kg or N"),
        ("", "'' is no weight"),
        ("1 N,nan N", "'nan N' is no weight"),
        ("1 N,1e999 N", "'1e999 N' is no weight"),
        ("1 N", "1 given; 2 or more"),
        ("1 N,-2 N", "-2 N is no weight to put on"),
        ("0 N,2 N", "0 N is no weight to put on"),
        ("2 N,1 N,2.000 N", "the same weight twice"),
        ("1 N,3 kg", r"29.42 N is above limits.force_N, 20 N"),
    ],
)
def test_weights_that_do_not_fit_are_refused(text: str, sentence: str) -> None:
    with pytest.raises(UsageError, match=sentence):
        parsed(text)
