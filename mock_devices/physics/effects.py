"""The library of effects that can be hidden in the bench, by name; each parameter's name carries its unit.

All are off by default. ``friction.level_N=0.2`` switches friction on with that level and its other parameters at their
defaults; ``friction`` alone takes all defaults.
"""

from collections.abc import Iterable, Mapping
from dataclasses import fields

from mock_devices.physics.chain import HiddenEffect, Knob
from mock_devices.physics.effects_motion import Backlash, ContactOffset, FrameCompliance, PositionRipple, SurfaceMotion
from mock_devices.physics.effects_sensing import (
    ClockDrift,
    Cogging,
    CrossTalk,
    FilterLag,
    Friction,
    GainError,
    SensorHysteresis,
    Temperature,
    TimeOffset,
    TipInertia,
    TrackerLatency,
    ZeroDrift,
)
from mock_devices.physics.effects_tissue import (
    Adhesion,
    ElasticLaw,
    HuntCrossleyDamping,
    Mullins,
    PowerLawRelaxation,
    Preconditioning,
    RateLaw,
    Relaxation,
    Substrate,
)
from rig.errors import UsageError
from rig.registry import known

Hidden = dict[str, dict[str, float]]

# The order is that of the chain: effects at the same place act one after the other as they stand here.
EFFECTS: dict[str, type[HiddenEffect]] = {
    "position_ripple": PositionRipple,
    "backlash": Backlash,
    "frame_compliance": FrameCompliance,
    "contact_offset": ContactOffset,
    "surface_motion": SurfaceMotion,
    "surface_motion_harmonic": SurfaceMotion,
    "elastic_law": ElasticLaw,
    "substrate": Substrate,
    "mullins": Mullins,
    "preconditioning": Preconditioning,
    "rate_law": RateLaw,
    "hunt_crossley": HuntCrossleyDamping,
    "relaxation": Relaxation,
    "second_relaxation": Relaxation,
    "third_relaxation": Relaxation,
    "power_law_relaxation": PowerLawRelaxation,
    "adhesion": Adhesion,
    "friction": Friction,
    "cogging": Cogging,
    "cross_talk": CrossTalk,
    "tip_inertia": TipInertia,
    "sensor_hysteresis": SensorHysteresis,
    "filter_lag": FilterLag,
    "clock_drift": ClockDrift,
    "gain_error": GainError,
    "temperature": Temperature,
    "zero_drift": ZeroDrift,
    "time_offset": TimeOffset,
    "tracker_latency": TrackerLatency,
}


def knobs(effect: str) -> dict[str, Knob]:
    """Parameters of ``effect`` by name; the first is its amplitude."""
    return {item.name: item.metadata["knob"] for item in fields(EFFECTS[effect]) if item.init}


def defaults(effect: str) -> dict[str, float]:
    """What the parameters of ``effect`` are where it is switched on by name only."""
    return {name: knob.default for name, knob in knobs(effect).items()}


def statement(effect: str) -> str:
    """What ``effect`` does, in one sentence."""
    return (EFFECTS[effect].__doc__ or "").partition("\n")[0]


def parse_hidden(options: Iterable[str]) -> Hidden:
    """``effect`` or ``effect.parameter=value``, several of them, as complete effects; raises UsageError."""
    wanted: Hidden = {}
    for option in options:
        name, equals, text = option.strip().partition("=")
        effect, dot, parameter = name.partition(".")
        chosen = wanted.setdefault(known(effect, EFFECTS, "effect"), {})
        if dot or equals:
            chosen[known(parameter, knobs(effect), f"parameter of {effect}")] = _number(option, equals, text)
    return complete(wanted)


def complete(wanted: Mapping[str, Mapping[str, float]]) -> Hidden:
    """``wanted`` with its missing parameters at their defaults, in the order of the chain; raises UsageError."""
    for effect, values in wanted.items():
        known(effect, EFFECTS, "effect")
        for parameter, value in values.items():
            _within(effect, parameter, value)
    return {effect: defaults(effect) | dict(wanted[effect]) for effect in EFFECTS if effect in wanted}


def build(effect: str, values: Mapping[str, float]) -> HiddenEffect:
    """The operator of ``effect`` at rest."""
    return EFFECTS[effect](**values)


def _within(effect: str, parameter: str, value: float) -> None:
    bounds = knobs(effect)[known(parameter, knobs(effect), f"parameter of {effect}")]
    if not bounds.low <= value <= bounds.high:
        raise UsageError(
            f"hide: {effect}.{parameter} is {value:g}, outside {bounds.low:g} to {bounds.high:g} ({bounds.meaning})"
        )


def _number(option: str, equals: str, text: str) -> float:
    try:
        return float(text)
    except ValueError as error:
        wrote = repr(text) if equals else "no value"
        raise UsageError(f"--hide {option}: {wrote} is not a number; write for example friction.level_N=0.2") from error
