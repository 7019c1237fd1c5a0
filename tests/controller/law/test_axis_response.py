"""Where the axis' response comes from where it was not identified: what the configuration states."""

import math

import pytest

from controller.law.axis_response import rates_of, response_of
from rig.config.wiring import Wiring


def wired(**changes: object) -> Wiring:
    return Wiring.model_validate(changes)


def test_two_lags_have_the_bandwidth_that_is_stated_and_with_the_delay_the_lag() -> None:
    found = response_of(wired(axis={"bandwidth_Hz": 20.0, "delay_ms": 5.0}))
    s = 2j * math.pi * 20.0
    assert abs(1 / ((1 + s * found.lag1_s) * (1 + s * found.lag2_s))) == pytest.approx(math.sqrt(0.5))
    assert found.lag_s == pytest.approx(0.005 + 1 / (2 * math.pi * 20.0))


def test_the_tip_is_earlier_than_the_force_by_what_the_sensor_takes() -> None:
    near, far = (response_of(wired(force={"latency_ms": latency_ms})) for latency_ms in (0.0, 1.0))
    assert near.lag_s == far.lag_s
    assert near.tip_lag_s - far.tip_lag_s == pytest.approx(0.001)
    assert 0 < near.tip_lag_s < near.lag_s


def test_a_sensor_of_100_Hz_delays_by_half_of_what_its_samples_are_apart_more() -> None:
    fast, slow = wired(), wired(force={"product": "robotiq-ft300"})
    assert response_of(slow).delay_s - response_of(fast).delay_s == pytest.approx(0.0045)
    assert (rates_of(fast), rates_of(slow)) == ((0.001, 0.001), (0.001, 0.01))


def test_a_sensor_faster_than_the_loop_is_read_once_a_cycle() -> None:
    assert rates_of(wired(loop={"rate_Hz": 500})) == (0.002, 0.002)
