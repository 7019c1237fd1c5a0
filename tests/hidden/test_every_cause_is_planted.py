"""Every declared cause is hidden by the other program and by the mock bench, in sizes that can be named and found."""

from collections.abc import Collection, Iterator

import numpy as np

from benchmarks.hidden.draw import KNOWN, draw_secret
from mock_devices.physics.effects import EFFECTS
from rig.diagnosis.effects.registry import CAUSES
from rig.diagnosis.problem import Effect, Par

DRAWS = 100
# What cannot be asked for, and why.
NOT_HIDDEN = {"gain_error": "no session has a weight on its tip, without which it looks like another stiffness"}
NOT_SIZED = {
    "exponent": "the other program's elastic laws are sums, no index law times a factor",
    "quadratic_per_mm": "as for the exponent",
    "cross_talk_sag_N": "a quarter of the whole, as for a square; planted in tests/rig/diagnosis/test_planted_sizes.py",
    **dict.fromkeys(("fung_per_mm", "ogden_per_mm", "layer_ratio"), "planted in tests/rig/diagnosis/test_forms.py"),
}


def sizes(cause: Effect) -> Iterator[tuple[str, Par]]:
    """The cause's sizes by the name they have in an answer: sine and cosine are one."""
    for par in cause.amplitudes:
        if "_cos" not in par.name:
            yield par.name.replace("_sin", ""), par


def unplanted(causes: Collection[Effect]) -> list[str]:
    """What of the declarations no plant proves, a sentence each."""
    found = [f"{cause.name} is no effect of the mock bench" for cause in causes if cause.name not in EFFECTS]
    for cause in causes:
        if cause.name not in KNOWN:
            found += [] if cause.name in NOT_HIDDEN else [f"{cause.name} is never hidden"]
            continue
        drawn = [draw_secret(np.random.default_rng(seed), cause.name).expected for seed in range(DRAWS)]
        for name, par in sizes(cause):
            planted = [expected[name] for expected in drawn if name in expected]
            if not planted:
                found += [] if name in NOT_SIZED else [f"{cause.name} is hidden without {name} [{par.unit}]"]
            elif not all(par.low < size < par.high and abs(size - par.null) >= par.least for size in planted):
                told = f"{min(planted):g} to {max(planted):g} of {par.low:g} to {par.high:g} {par.unit}"
                found.append(f"{cause.name} is hidden with {name} {told}, smallest named {par.least:g}")
    return found


def test_every_cause_is_planted_with_a_size_that_its_declaration_allows() -> None:
    assert unplanted(CAUSES.values()) == []
    assert {cause.name for cause in CAUSES.values()} == EFFECTS.keys() >= set(KNOWN)


def test_a_cause_without_a_plant_is_reported_by_what_it_lacks() -> None:
    size = Par("curvature_per_N", "1/N", 0.0, -0.05, 0.05, 0.002, least=0.001)
    bent = Effect("sensor_curvature", "", (size,))
    assert unplanted([bent]) == ["sensor_curvature is no effect of the mock bench", "sensor_curvature is never hidden"]
    assert unplanted([Effect("friction", "", (size,))]) == ["friction is hidden without curvature_per_N [1/N]"]
    narrow = Par("friction_N", "N", 0.0, 0.0, 0.2, 0.02, least=0.1)
    (told,) = unplanted([Effect("friction", "", (narrow,))])
    assert told.startswith("friction is hidden with friction_N 0.03") and told.endswith("smallest named 0.1")
