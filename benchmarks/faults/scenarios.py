"""What the bench does while a fault happens: a press with the force loop, an indentation, or resting in contact."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np

from controller.experiments import capture, tracked
from controller.experiments.references import parse_reference
from controller.loop.steps import Approach, Compress, MoveTo, Program, Retract, TrackForce, Zero
from controller.operation import Operation
from controller.supervisor import Supervisor
from mock_devices.testing.models import index_model
from rig.config.protocol import Indentation
from rig.config.quality import Bounds, QualityLimits
from rig.config.wiring import Wiring

Truth = dict[str, float]
"""Figures of the bench by name, as `rig mock` tells them."""

MODEL = index_model(0.12, 0.22, 0.01, force_N=11.0)
"""The mock bench's own forearm."""
PRESSES = parse_reference("press:2,base_N=1,frequency_Hz=1,duration_s=5")
SURFACE_MM = 20.0
NEAR_MM = 15.0
"""Short of the surface; far enough from 0 for the tracker to be registered to the axis."""
SEARCH_TO_MM = 28.0
REST_DEPTH_MM = 4.0
ANYTHING = 1e12
REST_N = float(MODEL.law.elastic(np.array(REST_DEPTH_MM)))
INDENTATION = Indentation(
    name="campaign",
    speeds_mm_s=(10.0,),
    trials=1,
    depth_mm=7.0,
    air_dwell_s=0.3,
    approach_speed_mm_s=20.0,
    search_to_mm=SEARCH_TO_MM,
    hold_s=2.0,
    retract_speed_mm_s=20.0,
    rest_s=0.3,
    touches=0,
    quality=QualityLimits(repeats=0),
    force_limit_N=15.0,
)


@dataclass(frozen=True)
class Ended:
    """How a scenario ended: the cause, the trial's verdict, and the measures that keep it from being good."""

    cause: str
    verdict: str = ""
    measures: tuple[str, ...] = ()
    refused: bool = False


@dataclass(frozen=True)
class Scenario:
    """``perform`` runs it into a folder; a fault comes at a random moment after ``ready`` holds for the first time.

    ``at_rest``: it is over by then, and the tip stays where it is.
    """

    perform: Callable[[Supervisor, Path], Ended]
    ready: Callable[[Truth], bool]
    at_rest: bool = False


def _press(rig: Supervisor, folder: Path) -> Ended:
    done = tracked.recorded_run(rig, press_program(rig.wiring), folder, "")
    return Ended(done.outcome.cause or "complete")


def press_program(wiring: Wiring) -> Program:
    """1 to 3 N once a second; the way there is faster than a capture's, nothing else differs."""
    planned = tracked.plan_reference(PRESSES, MODEL, wiring)
    presses = tuple(step for step in planned.steps if isinstance(step, TrackForce))
    return planned.model_copy(update={"steps": (*_touch(), *presses, Retract(clearance_mm=5.0, speed_mm_s=20.0))})


def _touch() -> tuple[Zero, MoveTo, Approach]:
    return (
        Zero(duration_s=0.3),
        MoveTo(position_mm=NEAR_MM, speed_mm_s=40.0),
        Approach(speed_mm_s=10.0, contact_force_N=0.1, search_to_mm=SEARCH_TO_MM),
    )


def _indent(rig: Supervisor, folder: Path, **changes: Any) -> Ended:
    protocol = INDENTATION.model_copy(update=changes)
    info = capture.capture(rig, protocol, folder, Operation("campaign"))
    trial = info.trials[-1]
    return Ended(trial.outcome, trial.quality, beyond_good(trial.measured, protocol.quality))


def beyond_good(measured: Mapping[str, float], limits: QualityLimits) -> tuple[str, ...]:
    """Names of what was measured beyond its good bound."""
    return tuple(name for name, value in measured.items() if value > _bounds(limits, name).good)


def _bounds(limits: QualityLimits, name: str) -> Bounds:
    found: Bounds = getattr(limits, name.rpartition(".")[2])
    return found


def blind(limits: QualityLimits) -> QualityLimits:
    """``limits`` that find every trial good."""
    anything = {name: Bounds(good=ANYTHING) for name, value in limits if isinstance(value, Bounds)}
    return limits.model_copy(update=anything)


def _rest(rig: Supervisor, folder: Path) -> Ended:
    """Leaves the tip in contact, idle."""
    steps = (*_touch(), Compress(depth_mm=REST_DEPTH_MM, speed_mm_s=10.0, force_limit_N=5.0))
    done = tracked.recorded_run(rig, Program(name="rest in contact", steps=steps), folder, "")
    return Ended(done.outcome.cause or "complete")


def _safe(rig: Supervisor, folder: Path) -> Ended:
    """Leaves the tip in contact after an emergency stop."""
    ended = _rest(rig, folder)
    rig.estop()
    rig.wait_at_rest()
    return ended


def _rests_in_contact(truth: Truth) -> bool:
    return truth["tip.depth_mm"] > REST_DEPTH_MM - 0.1 and abs(truth["tip.velocity_mm_s"]) < 0.5


def _holds(truth: Truth) -> bool:
    return truth["tip.depth_mm"] > INDENTATION.depth_mm - 0.1


SCENARIOS = {
    "press": Scenario(_press, lambda truth: truth["tip.force_N"] > 0.95),
    "hold": Scenario(_indent, _holds),
    "loading": Scenario(_indent, lambda truth: truth["tip.depth_mm"] > 0.5 and truth["tip.velocity_mm_s"] > 5.0),
    "fast": Scenario(partial(_indent, speeds_mm_s=(30.0,)), lambda truth: truth["tip.depth_mm"] > 0.0),
    "twice": Scenario(partial(_indent, trials=2), _holds),
    "approach": Scenario(_indent, lambda truth: truth["tip.position_mm"] > NEAR_MM - 5.0),
    "idle": Scenario(_rest, _rests_in_contact, at_rest=True),
    "safe": Scenario(_safe, _rests_in_contact, at_rest=True),
}
