"""No configuration reaches beyond the product's maxima, and what the product needs for itself stays within them."""

import math

import pytest

from api.cli.mock_bench import patient
from rig.config.maxima import MAXIMA, Maximum
from rig.config.products import maxon_epos4
from rig.config.products.registry import FORCE_SENSORS
from rig.config.products.roles import ForceProduct
from rig.config.table import merged, parse
from rig.config.wiring import Limits, Wiring
from rig.errors import UsageError


def given(key: str, value: float) -> Wiring:
    """The default wiring with one key changed."""
    return parse(Wiring, merged({}, [f"{key}={value:.15g}"]), "rig.toml")


@pytest.mark.parametrize("maximum", [*MAXIMA, *maxon_epos4.MAXIMA], ids=lambda maximum: str(maximum.key))
@pytest.mark.parametrize("more", [1.0, 1e9])
def test_whatever_is_above_its_maximum_is_refused_with_key_value_maximum_and_reason(
    maximum: Maximum, more: float
) -> None:
    key, largest, unit, reason = maximum
    assert given(key, largest)
    with pytest.raises(UsageError) as refusal:
        given(key, largest + more)
    said = str(refusal.value)
    assert key in said and reason in said and f"maximum, {largest:g} {unit}" in said
    assert "\n" not in said and said.count(key) == 1


def test_every_limit_of_the_wiring_has_a_maximum() -> None:
    known = {maximum.key for maximum in MAXIMA}
    bounded_elsewhere = {"position_min_mm", "retract_speed_mm_s", "when_pushed"}
    assert {f"limits.{name}" for name in Limits.model_fields if name not in bounded_elsewhere} == {
        key for key in known if key.startswith("limits.")
    }
    with pytest.raises(UsageError, match="is above speed_mm_s 60"):
        given("limits.retract_speed_mm_s", 1e9)
    with pytest.raises(UsageError, match="greater than or equal to -500"):
        given("limits.position_min_mm", -1e9)


@pytest.mark.parametrize(("key", "most"), [("max_age_days", "730 days"), ("max_uncertainty", "0.05 of the value")])
def test_no_word_makes_a_calibration_last_for_ever_or_good_enough_however_bad(key: str, most: str) -> None:
    with pytest.raises(UsageError, match=rf"calibration.{key} 1e\+09 .* is above its maximum, {most}"):
        given(f"calibration.{key}", 1e9)


def test_all_that_is_wrong_is_said_at_once() -> None:
    with pytest.raises(UsageError, match=r"(?=.*limits.force_N 60 N is above).*subject.pain_threshold_N 70 N is above"):
        parse(Wiring, merged({}, ["limits.force_N=60", "subject.pain_threshold_N=70"]), "rig.toml")


def test_the_force_ceiling_is_the_pressure_that_a_tip_of_6_mm_may_put_on_a_forearm() -> None:
    allowed_N = 180.0 * math.pi * 0.3**2
    ceilings = [maximum.value for maximum in MAXIMA if maximum.key in ("limits.force_N", "subject.pain_threshold_N")]
    assert ceilings == [50.0, 50.0]
    assert 0.95 * allowed_N < ceilings[0] < allowed_N


@pytest.mark.parametrize("sensor", FORCE_SENSORS.values(), ids=FORCE_SENSORS)
def test_a_limit_is_one_that_the_sensor_can_measure(
    sensor: type[ForceProduct], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(sensor, "range_N", 18.0)
    product, asked = sensor().product, [f"force.product={sensor().product}"]
    why = f"a {product} measures no more"
    if "capacity_N" in sensor.model_fields:  # what a transmitter can measure is what its load cell bears
        asked, why = [*asked, "force.capacity_N=18"], f"the load cell of the {product} bears no more"
    with pytest.raises(UsageError, match=f"limits.force_N 20 N .* 18 N: {why}"):
        parse(Wiring, merged({}, asked), "rig.toml")


def test_the_patience_that_mock_devices_need_is_within_the_maxima() -> None:
    assert Wiring.model_validate_json(patient(Wiring()).model_dump_json())
