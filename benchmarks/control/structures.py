"""Other structures of feedback at the law's own margins, over frequency: what a moving limb leaves of its motion.

python -m benchmarks.control.structures

*Observer*: the force says how fast the tip goes into the tissue, the axis' response how fast it went; what differs is
the limb's speed, which is added behind a filter in place of the second integral. *Smith predictor*: feedback on a model
of axis and tissue without delay, corrected by what differs from one with delay. Each is searched as the law is, over
lead, corner and filter; of those that keep the margins that is shown which leaves least of a limb at 2 Hz.
"""

import math
from collections.abc import Callable, Iterator, Sequence
from functools import partial
from typing import NamedTuple

import numpy as np

from benchmarks.control.__main__ import PLANTS
from benchmarks.control.plants import PLANT, Plant, model_of, wiring_of
from controller.experiments import tracking
from controller.law.loop_response import (
    Column,
    Complex,
    TrueTissue,
    common,
    drift,
    grid,
    margins,
    noise_share,
    tissue_ratio,
)
from controller.law.stability import ForceLoop
from controller.law.synthesis import MARGIN_DEG, MARGIN_GAIN, NOISE_SHARE, SPARE_S, as_modelled, leads, tissues
from rig.config.axis_response import AxisResponse

SUBJECT = "average"
SHOWN_HZ = (0.25, 1.0, 2.0)
BENCHES = ("sensor 100 Hz", "5 ms later", "12 ms later")
POINTS, SEARCH_STEPS = 120, 9
SHARES, FILTERS_S = (0.0, 0.1, 0.2, 0.3, 0.375), tuple(np.geomspace(0.002, 0.3, 10).tolist())


class Candidate(NamedTuple):
    """A structure's numbers: crossover, lead, and corner over crossover or the observer's filter."""

    crossover_rad_s: float
    lead_s: float
    third: float


OpenLoop = Callable[[ForceLoop, AxisResponse, Candidate, TrueTissue, Column], Complex]


def observer(
    loop: ForceLoop, axis: AxisResponse, by: Candidate, tissue: TrueTissue, omega: Column, order: int = 1
) -> Complex:
    """L = (wc leads / s + Q) G R / (1 - Q G), R the true tissue over the law's."""
    seen = 1 / (1 + 1j * omega * by.third) ** order
    there, known = (_axis(loop, one, omega) for one in (axis, loop.axis))
    feedback = by.crossover_rad_s * common(axis, loop.rates, by.lead_s, omega) + seen * there
    return np.asarray(feedback * tissue_ratio(tissue, loop.rates, omega) / (1 - seen * known))


def predictor(loop: ForceLoop, axis: AxisResponse, by: Candidate, tissue: TrueTissue, omega: Column) -> Complex:
    """L = C P / (1 + C (P0 - P0 exp(-s D))), P0 the axis without delay on tissue as the law takes it."""
    corner_rad_s = by.third * by.crossover_rad_s
    feedback = by.crossover_rad_s * drift(corner_rad_s, loop.rates, omega)
    late, soon, known = (
        feedback * common(one, loop.rates, by.lead_s, omega)
        for one in (axis, loop.axis._replace(delay_s=0.0), loop.axis)
    )
    return np.asarray(late * tissue_ratio(tissue, loop.rates, omega) / (1 + soon - known))


def _axis(loop: ForceLoop, axis: AxisResponse, omega: Column) -> Complex:
    """Speed of the tip over that commanded, the sensor's hold with it."""
    integral = loop.rates.cycle_s / (1 - np.exp(-1j * omega * loop.rates.cycle_s))
    return np.asarray(common(axis, loop.rates, 0.0, omega) / integral)


STRUCTURES: dict[str, tuple[OpenLoop, Sequence[float]]] = {
    "observer": (observer, FILTERS_S), "observer, two lags": (partial(observer, order=2), FILTERS_S),
    "Smith predictor": (predictor, SHARES),
}  # fmt: skip


def best(loop: ForceLoop, structure: OpenLoop, thirds: Sequence[float]) -> Candidate | None:
    """That which leaves least of a limb at 2 Hz."""
    leads_s = leads(loop.axis, loop.rates).tolist()
    tried = [_fastest(loop, structure, lead_s, third) for lead_s in leads_s for third in thirds]
    return min(filter(None, tried), key=lambda by: left(loop, structure, by)[-1], default=None)


def _fastest(loop: ForceLoop, structure: OpenLoop, lead_s: float, third: float) -> Candidate | None:
    low, high, found = 1.0, 400.0, None
    for _ in range(SEARCH_STEPS):
        by = Candidate(math.sqrt(low * high), lead_s, third)
        keeps = kept(loop, structure, by)
        found = by if keeps else found
        low, high = (by.crossover_rad_s, high) if keeps else (low, by.crossover_rad_s)
    return found


def kept(loop: ForceLoop, structure: OpenLoop, by: Candidate) -> bool:
    """Whether it keeps the law's own margins and share of noise; a loop that crosses nowhere keeps none."""
    omega, spared = grid(loop.rates, POINTS), loop.axis._replace(delay_s=loop.axis.delay_s + SPARE_S)
    late = structure(loop, spared, by, tissues(loop.span), omega)
    found = margins(late, omega)
    quiet = noise_share(structure(loop, loop.axis, by, as_modelled(loop.span), omega), omega, loop.rates)
    steady = np.all(found.phase_deg >= MARGIN_DEG) and np.all(found.gain >= MARGIN_GAIN)
    return bool(steady and np.all(quiet <= NOISE_SHARE) and np.all(np.abs(late[:, -1]) < 1))


def left(loop: ForceLoop, structure: OpenLoop, by: Candidate) -> list[float]:
    """|1 / (1 + L)| at SHOWN_HZ, the mean over depths."""
    omega = 2 * math.pi * np.array(SHOWN_HZ)
    found = 1 / np.abs(1 + structure(loop, loop.axis, by, as_modelled(loop.span), omega))
    return [float(value) for value in found.mean(axis=0)]


def rows(plant: Plant) -> Iterator[tuple[str, list[float]]]:
    """The law and the other structures on one bench."""
    loop = tracking.loop_for(model_of(SUBJECT), wiring_of(plant))
    law = loop.law
    same: OpenLoop = lambda loop, axis, _, tissue, omega: loop._replace(axis=axis).response(1.0, omega)  # noqa: E731, ARG005
    yield "law", left(loop, same, Candidate(*law))
    for name, (structure, thirds) in STRUCTURES.items():
        by = best(loop, structure, thirds)
        if by:
            yield name, left(loop, structure, by)


def main() -> None:
    """Prints a line for each structure and bench."""
    for bench, plant in {"bench": PLANT, **{name: PLANTS[name] for name in BENCHES}}.items():
        for name, shares in rows(plant):
            print(f"{bench:14} {name:20}", " ".join(f"{share:7.4f}" for share in shares), flush=True)


if __name__ == "__main__":
    main()
