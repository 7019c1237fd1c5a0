"""What a protocol will do on this bench to a tissue whose model is known, before anything moves."""

from collections.abc import Iterator, Sequence
from typing import Annotated, Literal

from fastapi import APIRouter, Query
from pydantic import Field

from api.http.access.rights import READ
from api.http.models import Name
from api.http.problems import responses
from api.http.service import Service
from controller.experiments.capture import check
from controller.experiments.indentation import ESTIMATING_S
from controller.loop.touch import BACK_OFF_MM
from rig.config.protocol import Indentation
from rig.errors import UsageError
from rig.results.base import Result
from rig.tissue.model import Model, load_model

ModelFolder = Literal["fit", "diagnosis"]
Verdict = Literal["refused", "unknown", "cut short", "as planned"]


class ExpectedForce(Result):
    """What to expect at one speed; ``ends`` is what ends the compression."""

    speed_mm_s: float
    depth_mm: float
    force_N: float
    ends: Literal["depth", "force limit"]


class Foresight(Result):
    """A protocol on this bench; ``expected`` is empty where no model is known."""

    protocol: str
    verdict: Verdict
    sentence: str
    doubt: str = Field(default="", description="what the model cannot say; empty if nothing")
    trials: int
    duration_s: float = Field(description="about, with one touch a trial and none made again")
    depth_mm: float
    force_limit_N: float
    expected: tuple[ExpectedForce, ...] = ()


def add(router: APIRouter, service: Service) -> None:
    """Its route."""

    @router.get(
        "/protocols/{name}/foresight",
        dependencies=[READ],
        summary="Force and depth to be expected of a protocol, by the model of a session where one is given",
        responses=responses("404 no-such-protocol", "404 no-such-session", "409 link", "422 refused"),
    )
    def foresight(
        name: Name,
        session: Annotated[str, Query(max_length=500, description="whose fitted model; empty: none")] = "",
        file: ModelFolder = "fit",
    ) -> Foresight:
        plan = service.plan(name)
        model = load_model(service.jobs.places("").session(session) / file / "model.json") if session else None
        refused = ""
        try:
            plan = check(plan, service.wiring)
        except UsageError as error:
            refused = str(error)
        return foresee(name, plan, model, refused)


def foresee(name: str, plan: Indentation, model: Model | None, refused: str) -> Foresight:
    """What is to be said of ``plan`` on the tissue of ``model``."""
    expected = tuple(_expected(plan, model)) if model else ()
    verdict, sentence = _verdict(plan, expected, refused)
    return Foresight(
        protocol=name,
        verdict=verdict,
        sentence=sentence,
        doubt=_doubt(expected, model) if model else "",
        trials=len(plan.speeds_mm_s) * plan.trials,
        duration_s=plan.trials * sum(_trial_s(plan, speed) for speed in plan.speeds_mm_s),
        depth_mm=plan.deepest_mm,
        force_limit_N=plan.force_limit_N,
        expected=expected,
    )


def _expected(plan: Indentation, model: Model) -> Iterator[ExpectedForce]:
    """By the law, loaded from contact at each speed; the compression ends where the force limit comes first."""
    for speed in sorted(plan.speeds_mm_s):
        force_N, limit_N = float(model.law.force(plan.deepest_mm, speed)), plan.force_limit_N
        if force_N <= limit_N:
            yield ExpectedForce(speed_mm_s=speed, depth_mm=plan.deepest_mm, force_N=force_N, ends="depth")
        else:
            depth_mm = float(model.law.depth(limit_N, speed))
            yield ExpectedForce(speed_mm_s=speed, depth_mm=depth_mm, force_N=limit_N, ends="force limit")


def _verdict(plan: Indentation, expected: Sequence[ExpectedForce], refused: str) -> tuple[Verdict, str]:
    limit = f"the force limit of {plan.force_limit_N:.3g} N"
    if refused:
        return "refused", refused
    if not expected:
        return "unknown", f"without a model of this tissue its force is not known: {limit} ends each compression"
    short = [one for one in expected if one.ends == "force limit"]
    if short:
        least = min(one.depth_mm for one in short)
        return "cut short", (
            f"{limit} is expected to end {len(short)} of {len(expected)} speeds before {plan.deepest_mm:g} mm, "
            f"the fastest at {least:.2g} mm"
        )
    most = max(expected, key=lambda one: one.force_N)
    return "as planned", (
        f"{most.force_N:.2g} N at most are expected, at {most.speed_mm_s:g} mm/s and {most.depth_mm:g} mm; "
        f"{limit} is not reached"
    )


def _doubt(expected: Sequence[ExpectedForce], model: Model) -> str:
    deepest_mm = max(one.depth_mm for one in expected)
    if deepest_mm <= model.valid.depth_mm:
        return ""
    return (
        f"the model was fitted down to {model.valid.depth_mm:.3g} mm and {model.valid.force_N:.3g} N: "
        f"what it says of {deepest_mm:.3g} mm is a guess"
    )


def _trial_s(plan: Indentation, speed_mm_s: float) -> float:
    """One trial from rest above the surface to rest, its surface found by one slow touch."""
    touch_s = BACK_OFF_MM / plan.touch_speed_mm_s + BACK_OFF_MM / plan.retract_speed_mm_s + ESTIMATING_S
    approach_s = plan.clearance_mm / plan.approach_speed_mm_s + (touch_s if plan.touches else 0.0)
    presses = [plan.depth_mm, *([plan.second_depth_mm] if plan.second_depth_mm else [])]
    press_s = (max(presses) + plan.run_up_mm) / speed_mm_s + plan.hold_s * len(presses) + plan.dither_s
    away_s = (plan.run_up_mm + max(presses) + plan.clearance_mm) / plan.retract_speed_mm_s
    return plan.air_dwell_s + approach_s + press_s + away_s + plan.rest_s
