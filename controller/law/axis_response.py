"""Where the force law gets the axis' response from."""

import math

from controller.law.loop_response import Rates
from rig.config.axis_response import AxisResponse
from rig.config.wiring import Wiring

# Two equal lags are -3 dB together where w tau = sqrt(sqrt(2) - 1).
LAG_AT_3_DB = math.sqrt(math.sqrt(2.0) - 1.0)


def response_of(wiring: Wiring) -> AxisResponse:
    """The response that was identified; else what bandwidth and delay in the configuration say of two equal lags.

    A sensor slower than the loop is taken to average over its period, which delays by half of it.
    """
    known = getattr(wiring.calibration, "of_dynamics", None)
    if known is not None:
        found: AxisResponse = known.response
        return found
    axis, force, cycle_s = wiring.axis, wiring.force, 1.0 / wiring.loop.rate_Hz
    corner_s = 1.0 / (2 * math.pi * axis.bandwidth_Hz)
    lag_s = LAG_AT_3_DB * corner_s
    slower_s = 0.5 * max(0.0, 1.0 / force.sampled_Hz - cycle_s)
    sensor_s = slower_s + force.latency_ms * 1e-3 + 0.5 * cycle_s
    delay_s = max(axis.delay_ms * 1e-3 + corner_s - 2 * lag_s, 0.0)
    return AxisResponse(delay_s + slower_s, lag_s, lag_s, max(delay_s + 2 * lag_s + slower_s - sensor_s, 0.0))


def rates_of(wiring: Wiring) -> Rates:
    """How often the loop turns and how often force is sampled; a faster sensor is read once a cycle."""
    cycle_s = 1.0 / wiring.loop.rate_Hz
    return Rates(cycle_s, max(cycle_s, 1.0 / wiring.force.sampled_Hz))
