"""Margins with a response as it was measured: those of the fit where it is the fit, less where the axis is worse."""

from collections.abc import Callable

import numpy as np
import pytest

from benchmarks.control import wire_margins
from benchmarks.control.plants import PLANT, SUBJECTS, model_of, wiring_of
from controller.commissioning.axis_dynamics import FrequencyResponse
from controller.experiments import tracking
from controller.law.axis_response import rates_of
from controller.law.loop_response import Complex, grid, margins, open_loop
from controller.law.synthesis import SPARE_S, tissues

LINES_HZ = np.geomspace(3.0, 85.0, 24)


def measured(worse: Callable[[Complex], Complex] = np.ones_like) -> FrequencyResponse:
    """The axis as it was identified, times ``worse`` of s = j w."""
    known = wiring_of(PLANT).calibration.of_dynamics
    assert known is not None
    s = np.asarray(2j * np.pi * LINES_HZ)
    fitted = np.exp(-s * known.delay.s) / ((1 + s * known.lag1.s) * (1 + s * known.lag2.s))
    mean = np.asarray(fitted * worse(s))
    return FrequencyResponse(LINES_HZ, mean, mean[None], np.ones(len(mean)))


def margins_of(subject: str, response: FrequencyResponse) -> wire_margins.BenchMargins:
    return wire_margins.margins_of(subject, wiring_of(PLANT), response)


@pytest.mark.parametrize("subject", SUBJECTS)
def test_an_axis_that_answers_as_it_was_identified_keeps_what_is_promised(subject: str) -> None:
    found = margins_of(subject, measured())
    assert found.phase_deg >= 44.9
    assert found.gain_dB >= 5.9
    assert wire_margins.missed([found]) == []


def test_a_later_axis_costs_the_phase_of_its_delay_at_the_crossover() -> None:
    wiring = wiring_of(PLANT)
    loop, omega = tracking.loop_for(model_of("average"), wiring), grid(rates_of(wiring), 1000)
    late = loop.axis._replace(delay_s=loop.axis.delay_s + SPARE_S + 0.002)
    expected = margins(open_loop(late, loop.rates, loop.law, tissues(loop.span), omega), omega)
    found = margins_of("average", measured(lambda s: np.exp(-0.002 * s)))
    assert found.phase_deg == pytest.approx(float(expected.phase_deg.min()), abs=0.3)


@pytest.mark.parametrize(
    ("worse", "what"),
    [
        (lambda s: np.exp(-0.004 * s), "4 ms later"),
        (lambda s: np.full_like(s, 1.5), "a drive that goes half as far again"),
        (lambda s: 1 / (1 + 0.006 * s), "a third lag"),
        (lambda s: 1 / (1 + 0.1 * s / 220 + (s / 220) ** 2), "a resonance at 35 Hz"),
    ],
)
def test_an_axis_that_is_worse_than_it_was_identified_is_no_confirmation(
    worse: Callable[[Complex], Complex], what: str, capsys: pytest.CaptureFixture[str]
) -> None:
    sentences = wire_margins.show([margins_of(subject, measured(worse)) for subject in SUBJECTS])
    assert sentences, what
    assert f"NOT CONFIRMED: {sentences[0]}" in capsys.readouterr().out


def test_one_line_that_is_off_is_seen() -> None:
    """What is measured counts, not a curve through it: the line at which the loop turns halves its margin of gain."""
    found = [margins_of("average", measured(one_off(at))) for at in range(len(LINES_HZ))]
    assert wire_margins.missed([min(found, key=lambda one: one.gain_dB)])
    assert not wire_margins.missed([found[0]]), "3 Hz are below every crossing"


def one_off(at: int) -> Callable[[Complex], Complex]:
    """Twice as far at one line."""
    return lambda s: np.where(np.arange(len(s)) == at, 2.0 + 0j, 1.0)


def test_a_loop_that_crosses_nowhere_and_a_response_that_is_no_number_are_no_confirmation() -> None:
    for phase_deg, gain_dB in ((np.inf, 8.0), (50.0, np.inf), (np.nan, 8.0), (50.0, np.nan)):
        assert wire_margins.missed([wire_margins.BenchMargins("soft", phase_deg, gain_dB)])


def test_sweeps_are_averaged_as_complex_numbers() -> None:
    """A delay that comes and goes: means of magnitude alone would not see what it costs."""
    sides = [measured(lambda s: np.exp(-0.001 * s)), measured(lambda s: np.exp(0.001 * s))]
    both = wire_margins.mean_of(sides)
    off = both.mean / measured().mean
    assert off == pytest.approx(np.cos(2 * np.pi * LINES_HZ * 0.001), abs=1e-12)
    assert both.left_out.shape == (2, len(LINES_HZ))
