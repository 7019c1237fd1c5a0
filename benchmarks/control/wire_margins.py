"""How far the law is from instability on the mock bench, by the response that the bench's axis shows now.

The law is made from the response that was identified: a delay and two lags, fitted once. Here the axis is swept anew,
and what it did at each frequency takes the place of what was fitted: wires, drive and encoder are in it, and no fit.
Tissue is half to twice as stiff as the model, and the spare delay is used up.
"""

import math
from collections.abc import Sequence
from datetime import UTC, datetime
from typing import NamedTuple

import numpy as np

from api.cli.mock_bench import bench_for
from api.cli.mock_calibration import in_the_air
from api.cli.mock_dynamics import swept
from benchmarks.control.goals import DB, DEG
from benchmarks.control.plants import SUBJECTS, model_of
from controller.commissioning.axis_dynamics import FrequencyResponse, identify, model, response_of
from controller.experiments import tracking
from controller.law.axis_response import rates_of
from controller.law.loop_response import Column, Complex, grid, margins, open_loop
from controller.law.stability import ForceLoop
from controller.law.synthesis import SPARE_S, tissues
from mock_devices.control import BenchControl
from rig.computer import computer_id
from rig.config.axis_dynamics import AxisDynamics
from rig.config.wiring import Wiring
from rig.errors import CheckFailed, DeviceError

# What a bench confirms is within a third of what is promised.
CONFIRMED_DEG, CONFIRMED_DB = DEG * 2 / 3, DB * 2 / 3
# As long as those of `rig calibrate axis --dynamics`; one alone knows gain at 80 Hz, where the loop turns, to a tenth.
SWEEP_S, REPEATS, SWEEPS = 1.0, 6, 6
TRIES = 8  # beside other programs one sweep in four misses its bounds
POINTS = 1000


class BenchMargins(NamedTuple):
    """The smallest over all depths and stiffnesses of one subject."""

    subject: str
    phase_deg: float
    gain_dB: float


def on_bench() -> list[BenchMargins]:
    """Of every subject's law, by new sweeps of a bench on which the axis was identified before."""
    with bench_for(Wiring()) as (live, endpoints):
        assert endpoints is not None, "the built-in wiring is the mock bench"
        with BenchControl(endpoints.control) as control, in_the_air(control):
            response = mean_of([_response(live) for _ in range(SWEEPS)])
    return [margins_of(subject, live, response) for subject in SUBJECTS]


def _response(live: Wiring) -> FrequencyResponse:
    """Of one sweep by which the axis could be identified; what the computer was too late for says nothing of it."""
    for again in reversed(range(TRIES)):
        try:
            found = swept(live, SWEEP_S, REPEATS)
            identify(*found, datetime.now(UTC), computer_id())
        except (CheckFailed, DeviceError):
            if not again:
                raise
        else:
            break
    _, _, sweep, followed = found
    return response_of(sweep, followed)


def mean_of(found: Sequence[FrequencyResponse]) -> FrequencyResponse:
    """Of several sweeps alike; each stands for a repeat."""
    means = np.array([one.mean for one in found])
    coherence = np.min([one.coherence for one in found], axis=0)
    return FrequencyResponse(found[0].frequency_Hz, means.mean(axis=0), means, coherence)


def margins_of(subject: str, live: Wiring, response: FrequencyResponse) -> BenchMargins:
    """Of the law that ``live`` gives this subject, where its axis answers by ``response``."""
    known = live.calibration.of_dynamics
    assert known is not None, "a mock axis is identified when it is plugged in"
    omega = grid(rates_of(live), POINTS)
    found = margins(measured_loop(tracking.loop_for(model_of(subject), live), known, response, omega), omega)
    return BenchMargins(subject, float(found.phase_deg.min()), 20 * math.log10(float(found.gain.min())))


def measured_loop(loop: ForceLoop, known: AxisDynamics, response: FrequencyResponse, omega: Column) -> Complex:
    """Open loop with the spare delay, the measured response in place of the fitted, shape (tissues, frequencies).

    Between lines magnitude and phase go on evenly over log frequency; beyond the first and the last they stay as far
    off the fit as there.
    """
    late = loop.axis._replace(delay_s=loop.axis.delay_s + SPARE_S)
    short_s, long_s = known.lag1.s, known.lag2.s
    off = response.mean / model(response.frequency_Hz, 1.0, known.delay.s, short_s + long_s, short_s * long_s)
    at, lines = np.log(omega), np.log(2 * np.pi * response.frequency_Hz)
    size, turned = np.interp(at, lines, np.log(np.abs(off))), np.interp(at, lines, np.unwrap(np.angle(off)))
    return np.asarray(open_loop(late, loop.rates, loop.law, tissues(loop.span), omega) * np.exp(size + 1j * turned))


def missed(found: Sequence[BenchMargins]) -> list[str]:
    """Subjects on whom the bench does not confirm the margins, one sentence each."""
    return [
        f"margins on {one.subject}: {one.phase_deg:.1f} deg and {one.gain_dB:.1f} dB on the bench, less than two thirds"
        f" of the {DEG:g} deg and {DB:g} dB promised"
        for one in found
        if not (CONFIRMED_DEG <= one.phase_deg < math.inf and CONFIRMED_DB <= one.gain_dB < math.inf)
    ]


def show(found: Sequence[BenchMargins]) -> list[str]:
    """Prints them; returns what is not confirmed."""
    for one in found:
        print(f"margins with the axis as it was swept, {one.subject:8}: {one.phase_deg:.1f} deg, {one.gain_dB:.1f} dB")
    sentences = missed(found)
    for sentence in sentences:
        print("NOT CONFIRMED:", sentence)
    return sentences
