"""What a protocol could show, before anything is recorded: smallest amplitudes, and pairs it cannot separate.

The protocol's motion is laid out, the simulation run on it, and the information of every effect taken after everything
else is refitted. No data are involved, so this is what the design itself allows, on the tissue and noise assumed here.
"""

from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass

import numpy as np

from rig.config.protocol import Indentation as Protocol
from rig.diagnosis.answers import Diagnosis, invisible, smallest_visible
from rig.diagnosis.estimates import SAFE_NATS, NextExperiment, SmallestSize
from rig.diagnosis.evidence import Direction, Tangents, information, is_alias, tangents
from rig.diagnosis.fit import Fit, assemble
from rig.diagnosis.indentation import IndentationProblem, nulls
from rig.diagnosis.noise import Array, Colour, Noise, ScatterWhitener, starts_of
from rig.diagnosis.observations import Observations, observe
from rig.diagnosis.search import proposed, testable
from rig.diagnosis.whitening import Whitener, secants_of
from rig.tissue.laws_extended import Extended
from rig.tissue.model import Model
from rig.trials.trial import Trial, TrialSet

RATE_HZ = 1000.0
TRACKER_HZ = 60.0
SURFACE_MM = 20.0  # any place below the top of the way: all else counts from it
FORCE_NOISE_N = 0.003  # at the working rate
TRACKER_NOISE_MM = 0.06
SCATTER = np.array([0.01, 0.02, 0.003])
LIMB = {"a_N_mm": 0.12, "b_per_mm": 0.22, "damping_N_s_mm": 0.01, "surface_mm": SURFACE_MM}
THRESHOLD_NATS = 5.0
DEPTHS = 80  # 0.1 mm of an indentation of 8
ASSUMED_NATS = 50.0
BLOCKS = {
    "5 cycles at 4 to 30 mm/s": Protocol(speeds_mm_s=(4, 8, 12, 20, 30), trials=1, hold_s=0.2),
    "5 cycles with a hold of 5 s": Protocol(speeds_mm_s=(20,), trials=5, hold_s=5.0),
    "5 cycles with 1 s of dither, 0.25 mm at 6 Hz": Protocol(
        speeds_mm_s=(10,), trials=5, dither_amplitude_mm=0.25, dither_frequency_Hz=6, dither_s=1.0
    ),
    "5 cycles with 1 s of dither, 0.1 mm at 20 Hz": Protocol(
        speeds_mm_s=(10,), trials=5, dither_amplitude_mm=0.1, dither_frequency_Hz=20, dither_s=1.0
    ),
    "5 cycles with a stop at half depth": Protocol(speeds_mm_s=(10,), trials=5, depth_mm=4, second_depth_mm=8),
    "5 cycles with a slow way out, 2 mm/s": Protocol(speeds_mm_s=(10,), trials=5, retract_speed_mm_s=2),
}
NOT_SEPARABLE_NATS = 3.0  # odds of 20 to 1 (e^3)


@dataclass(frozen=True)
class Detectability:
    """Answer of a protocol check: smallest amplitudes, reasons, confusability [nats], duration.

    ``confusion[e][f]`` is what is left of 50 nats of evidence for e once f, with everything else, imitates it.
    """

    duration_s: float
    cycles: int
    detectable: Mapping[str, SmallestSize]
    not_testable: Mapping[str, str]
    names: tuple[str, ...]
    confusion: Array

    @property
    def pairs(self) -> list[tuple[str, str, float]]:
        """Pairs this protocol leaves ambiguous, the worst first."""
        found = []
        for i, one in enumerate(self.names):
            for j in range(i + 1, len(self.names)):
                left = float(min(self.confusion[i, j], self.confusion[j, i]))
                if left < SAFE_NATS:
                    found.append((one, self.names[j], left))
        return sorted(found, key=lambda pair: pair[2])


def check(
    protocol: Protocol, tracker: bool = True, force_rate_Hz: float = RATE_HZ, limb: Mapping[str, float] = LIMB
) -> Detectability:
    """What ``protocol`` can show on ``limb`` with a force sensor at this rate, with or without a tracker on the tip."""
    cycles = planned(protocol, tracker, force_rate_Hz)
    data = observe(TrialSet("planned", tuple(cycles)))
    problem = IndentationProblem(data)
    fit = noiseless(problem, limb)
    t = tangents(fit, proposed(testable(problem), fit.names))
    visible = smallest_visible(t, THRESHOLD_NATS)
    names, confusion = confusability(t)
    duration = float(cycles[-1].force_s[-1])
    reasons = invisible(problem, {*visible, *fit.names})
    return Detectability(duration, len(cycles), visible, reasons, names, confusion)


def limb_of(model: Model, depth_mm: float) -> dict[str, float]:
    """A fitted tissue as the chain has it: an extended law as it is, of any other the index law nearest to it.

    Of its relaxation the largest term is taken. Nearest is meant down to ``depth_mm``, or as far as was fitted.
    """
    law = model.law
    if isinstance(law, Extended):
        return {**asdict(law), "surface_mm": SURFACE_MM}
    depths_mm = np.linspace(0, min(depth_mm, model.valid.depth_mm), DEPTHS + 1)[1:]
    terms = sorted(law.terms)[-1:]
    memory = {"relaxation_ratio": terms[0].ratio, "tau_s": terms[0].tau_s} if terms else {}
    index = Extended.near(depths_mm, law.elastic(depths_mm))
    return {**index, "damping_N_s_mm": model.damping_N_s_mm, **memory, "surface_mm": SURFACE_MM}


def planned(protocol: Protocol, tracker: bool, rate_Hz: float) -> list[Trial]:
    """The cycles the protocol would record, with the force the limb would answer, without noise."""
    rng = np.random.default_rng(protocol.seed)
    speeds = [speed for speed in protocol.speeds_mm_s for _ in range(protocol.trials)]
    order = rng.permutation(len(speeds)) if protocol.randomise else np.arange(len(speeds))
    cycles, start = [], 0.0
    for number, speed in enumerate(np.asarray(speeds)[order]):
        time, position = cycle(protocol, float(speed), rate_Hz)
        time = time + start
        frames = np.arange(time[0], time[-1], 1 / TRACKER_HZ)
        marker = np.zeros((len(frames), 3))
        marker[:, 0] = np.interp(frames, time, position)
        seen = (frames, marker) if tracker else (None, None)
        cycles.append(Trial(f"cycle {number + 1}", time, np.zeros_like(time), time, position, *seen))
        start = float(time[-1]) + protocol.rest_s
    return cycles


def cycle(protocol: Protocol, speed: float, rate_Hz: float) -> tuple[Array, Array]:
    """Time [s] and axis position [mm] of one cycle, corners rounded over 12 ms as a drive does."""
    top, touch = SURFACE_MM - protocol.clearance_mm, SURFACE_MM + 0.2
    back, deep = SURFACE_MM - protocol.run_up_mm, SURFACE_MM + protocol.depth_mm
    legs = [(top, protocol.air_dwell_s), (touch, (touch - top) / protocol.approach_speed_mm_s)]
    legs += [(back, (touch - back) / protocol.approach_speed_mm_s), (deep, (deep - back) / speed)]
    legs += [(deep, protocol.hold_s)]
    if protocol.second_depth_mm:
        second = SURFACE_MM + protocol.second_depth_mm
        legs += [(second, abs(second - deep) / speed), (second, protocol.hold_s)]
        deep = second
    dither_from = sum(seconds for _, seconds in legs)
    legs += [(deep, protocol.dither_s), (top, (deep - top) / protocol.retract_speed_mm_s), (top, 0.2)]
    corners = np.cumsum([0.0, *(seconds for _, seconds in legs)])
    time = np.arange(0, corners[-1], 1 / rate_Hz)
    position = np.interp(time, corners, [top, *(place for place, _ in legs)])
    inside = (time >= dither_from) & (time < dither_from + protocol.dither_s)
    wave = np.sin(2 * np.pi * protocol.dither_frequency_Hz * (time - dither_from))
    position = position + np.where(inside, protocol.dither_amplitude_mm * wave, 0.0)
    width = max(1, round(0.012 * rate_Hz))
    padded = np.concatenate([np.full(width, position[0]), position])
    return time, np.convolve(padded, np.ones(width) / width, mode="valid")[1:]


def noiseless(problem: IndentationProblem, limb: Mapping[str, float] = LIMB) -> Fit:
    """The simulation of a limb, with what is off its null there, at the assumed noise, as if it had been fitted."""
    values = {**nulls(), **limb}
    there = [effect for effect in problem.effects if any(values[par.name] != par.null for par in effect.amplitudes)]
    seen, force_N = problem.data, problem.predict(values)[0]
    data = Observations(seen.name, seen.names, seen.drive, force_N, seen.tip_mm, None)
    problem = IndentationProblem(data, problem.simulation)
    colours = [Colour(np.empty(0), FORCE_NOISE_N), Colour(np.empty(0), TRACKER_NOISE_MM)][: len(problem.channels)]
    noise = Noise(tuple(colours), SCATTER, np.zeros((problem.recordings, len(SCATTER))))
    blind = problem.blind(values)
    secants = secants_of(problem, values, noise.shifts, problem.predict(values)[0])
    bare = Whitener(problem, noise, None, secants, blind)
    starts = starts_of(problem.channels[0].recording, problem.recordings)
    scatter = ScatterWhitener.of(colours[0].whiten(secants, bare.judged[0]), SCATTER, starts)
    return assemble(problem, there, values, Whitener(problem, noise, scatter, secants, blind))


def next_experiment(result: Diagnosis) -> NextExperiment | None:
    """The block of cycles that separates the first ambiguous set best, in nats a minute; else what is missing most.

    Each block is taken alone, on the limb as fitted, with the named effect at the size found.
    """
    sets = [finding for finding in result.findings if len(finding.effects) > 1]
    open_sets = [finding.effects for finding in sets if finding.shared_variable is None]
    if sets and not open_sets:
        return NextExperiment("5 cycles with a tip of another radius, or where the tissue is thicker", sets[0].effects)
    if not open_sets or result.search is None:
        if "frame_compliance" in result.not_testable and "tracker" in result.not_testable["frame_compliance"]:
            return NextExperiment("record again with a tracker on the tip")
        return None
    pair = open_sets[0][:2]
    rates = {name: _rate(block, result.search.after, pair) for name, block in BLOCKS.items()}
    best = max(rates, key=lambda name: rates[name])
    return NextExperiment(best, pair, rates[best], rates)


def _rate(protocol: Protocol, found: Fit, pair: Sequence[str]) -> float:
    """Nats a minute by which a block tells the first of the pair, at its size, from the second."""
    cycles = planned(protocol, tracker=True, rate_Hz=RATE_HZ)
    problem = IndentationProblem(observe(TrialSet("block", tuple(cycles))))
    base = {par.name: found.values[par.name] for par in problem.base if par.name in found.values}
    fit = noiseless(problem, {**base, "surface_mm": SURFACE_MM, "tip_zero_mm": 0.0})
    by_name = {effect.name: effect for effect in found.problem.effects}
    t = tangents(fit, [by_name[name] for name in pair])
    groups = middle_shapes(t)
    if pair[0] not in groups:
        return 0.0
    effect = by_name[pair[0]]
    size = sum((found.values[par.name] - par.null) ** 2 for par in effect.amplitudes) / len(effect.amplitudes)
    alternatives = groups.get(pair[1], [])
    left = min((_trace(t, groups[pair[0]][0], alternative.columns) for alternative in alternatives), default=0.0)
    minutes = float(cycles[-1].force_s[-1]) / 60
    return 0.5 * size * left / minutes


def confusability(t: Tangents) -> tuple[tuple[str, ...], Array]:
    """Names, and what is left of 50 nats for one effect when another imitates it, shape (effects, effects)."""
    chosen = middle_shapes(t)
    names = tuple(chosen)
    left = np.full((len(names), len(names)), ASSUMED_NATS)
    for i, one in enumerate(names):
        own = _trace(t, chosen[one][0], ())
        for j, other in enumerate(names):
            if i != j:
                best = min(_trace(t, chosen[one][0], alternative.columns) for alternative in chosen[other])
                left[i, j] = ASSUMED_NATS * best / max(own, 1e-300)
    return names, left


def middle_shapes(t: Tangents) -> dict[str, list[Direction]]:
    """Directions of each effect that is no alias, its middle shape first."""
    groups: dict[str, list[Direction]] = {}
    for direction in t.directions:
        if not is_alias(t, direction):
            groups.setdefault(direction.effect.name, []).append(direction)
    return {name: [group[len(group) // 2], *group] for name, group in groups.items()}


def _trace(t: Tangents, direction: Direction, alternatives: Sequence[int]) -> float:
    """Information on a direction's amplitudes after the model and the alternative's columns are refitted."""
    if not alternatives:
        return float(np.trace(information(t, direction)[1]))
    total = t.hessian.sum(axis=0)
    index = [*range(t.base), *alternatives]
    own = total[np.ix_(direction.columns, direction.columns)]
    across = total[np.ix_(index, direction.columns)]
    model = total[np.ix_(index, index)] + np.diag(t.ridge[index])
    return max(float(np.trace(own - across.T @ np.linalg.lstsq(model, across, rcond=1e-12)[0])), 0.0)
