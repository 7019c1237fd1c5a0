"""The search for the law's numbers: margins kept, by another program, to the last per cent; and what is refused."""

import control
import numpy as np
import pytest

from controller.law import synthesis
from controller.law.force_position import LINE_CYCLES
from controller.law.loop_response import Constants, Rates, TrueTissue, grid, noise_share, open_loop
from controller.law.synthesis import Span, constants, over_span, tissues, tolerated
from rig.config.axis_response import AxisResponse
from rig.errors import UsageError

AXIS = AxisResponse(0.002, 0.0025, 0.0037, 0.0067)
FAST, SLOW = Rates(0.001, 0.001), Rates(0.001, 0.01)
SPAN = Span((20.0, 80.0, 300.0), (1.0, 1.0, 1.0))


def judged(axis: AxisResponse, rates: Rates, law: Constants, tissue: TrueTissue) -> tuple[float, float]:
    """Phase and gain margin by python-control, of one tissue."""
    omega = grid(rates, 2000)
    gain, phase, *_ = control.margin(control.frd(open_loop(axis, rates, law, tissue, omega), omega))
    return float(phase), float(gain)


@pytest.mark.parametrize("rates", [FAST, SLOW], ids=["1 kHz", "100 Hz"])
@pytest.mark.parametrize("extra_s", [0.0, 0.003, 0.012])
def test_margins_hold_with_delay_to_spare_on_all_tissues(rates: Rates, extra_s: float) -> None:
    axis = AXIS._replace(delay_s=AXIS.delay_s + extra_s)
    law, late = constants(axis, rates, SPAN), axis._replace(delay_s=axis.delay_s + 0.001)
    every = np.transpose([np.asarray(part) for part in tissues(SPAN)])
    found = [judged(late, rates, law, TrueTissue(*map(float, values))) for values in every]
    assert min(phase for phase, _ in found) > 45.0 - 0.5
    assert min(gain for _, gain in found) > 2.0 * 0.99


def test_a_law_a_tenth_faster_would_not_keep_them() -> None:
    law, late = constants(AXIS, FAST, SPAN), AXIS._replace(delay_s=AXIS.delay_s + 0.001)
    faster = law._replace(crossover_rad_s=1.1 * law.crossover_rad_s, drift_rad_s=1.1 * law.drift_rad_s)
    found = over_span(late, FAST, faster, SPAN)
    assert np.min(found.phase_deg) < 45.0 or np.min(found.gain) < 2.0


@pytest.mark.parametrize("rates", [FAST, SLOW], ids=["1 kHz", "100 Hz"])
@pytest.mark.parametrize("extra_s", [0.0, 0.012])
def test_what_is_not_searched_could_not_have_been_the_best(rates: Rates, extra_s: float) -> None:
    axis = AXIS._replace(delay_s=AXIS.delay_s + extra_s)
    leads_s = np.linspace(0.0, 1.5 * max(axis.lag1_s + axis.lag2_s, rates.sample_s), synthesis.LEAD_STEPS)
    every = [synthesis._fastest(axis, rates, SPAN, lead_s, share) for lead_s in leads_s for share in synthesis.SHARES]
    best = max(law.crossover_rad_s * law.drift_rad_s for law in every)
    found = constants(axis, rates, SPAN)
    assert found.crossover_rad_s * found.drift_rad_s == best


def test_both_leads_are_worth_it() -> None:
    """Without them the loop that keeps the margins resists a moving limb a fifth as well."""
    law = constants(AXIS, FAST, SPAN)
    bare = max(
        (synthesis._fastest(AXIS, FAST, SPAN, 0.0, share) for share in synthesis.SHARES),
        key=lambda law: law.crossover_rad_s * law.drift_rad_s,
    )
    assert law.crossover_rad_s * law.drift_rad_s > 5 * bare.crossover_rad_s * bare.drift_rad_s


def test_more_delay_makes_a_slower_law() -> None:
    crossovers = [
        constants(AXIS._replace(delay_s=0.002 + extra_s), FAST, SPAN).crossover_rad_s
        for extra_s in (0.0, 0.001, 0.002, 0.005, 0.012, 0.03)
    ]
    assert crossovers == sorted(crossovers, reverse=True)
    assert crossovers[0] > 4 * crossovers[-2]


def test_tissue_less_known_gets_a_slower_law_that_holds_it() -> None:
    wide = SPAN._replace(stiffness=(0.3, 4.0), damping=(0.5, 1.5))
    law = constants(AXIS, FAST, wide)
    assert law.crossover_rad_s < constants(AXIS, FAST, SPAN).crossover_rad_s
    assert np.min(over_span(AXIS, FAST, law, wide).phase_deg) > 45.0


def test_the_same_question_has_the_same_answer() -> None:
    first = constants(AXIS, FAST, SPAN)
    constants.cache_clear()
    assert constants(AXIS, FAST, SPAN) == first


def test_a_delay_longer_than_the_law_remembers_is_refused_with_the_bound() -> None:
    late = AXIS._replace(delay_s=0.05)
    with pytest.raises(UsageError, match=r"the axis answers 50 ms late, above the 46 ms .* shorten the sensor's"):
        constants(late, FAST, SPAN)
    longest = AXIS._replace(delay_s=(LINE_CYCLES - 2) * 0.001)
    assert constants(longest, FAST, SPAN).crossover_rad_s > synthesis.LEAST_CROSSOVER_RAD_S


def test_margins_that_cannot_be_met_are_refused_with_what_could_be() -> None:
    lagging = AxisResponse(0.04, 0.2, 0.2, 0.2)
    with pytest.raises(UsageError, match=r"no force law keeps 45 deg and a factor of 2 .* 0\.5 to 50 times .* Hz"):
        constants(lagging, FAST, SPAN._replace(stiffness=(0.5, 50.0)))


@pytest.mark.parametrize("rates", [FAST, SLOW], ids=["1 kHz", "100 Hz"])
def test_the_sensors_noise_is_kept_out_of_the_tissue_by_half_or_more(rates: Rates) -> None:
    law, omega = constants(AXIS, rates, SPAN), grid(rates)
    loop = open_loop(AXIS, rates, law, synthesis.as_modelled(SPAN), omega)
    assert np.max(noise_share(loop, omega, rates)) <= 0.5


@pytest.mark.parametrize("at", [0, 1, 2])
def test_the_stiffest_tissue_that_is_tolerated_is_at_the_edge_of_stability(at: int) -> None:
    law = constants(AXIS, FAST, SPAN)
    factor = float(tolerated(AXIS, FAST, law, SPAN)[at])
    assert factor > 2.0
    corner = SPAN.corners_rad_s[at]
    assert judged(AXIS, FAST, law, TrueTissue(corner, factor, 1.0))[0] > 0
    assert judged(AXIS, FAST, law, TrueTissue(corner, 1.2 * factor, 1.0))[0] < 0
