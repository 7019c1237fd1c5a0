"""Five lines lead a diagnosis: whole sentences for who measures and treats, nothing in nats, nothing contradictory."""

from dataclasses import replace
from itertools import product
from types import SimpleNamespace

import pytest

from rig.diagnosis.estimates import (
    AxisPrediction,
    EffortGain,
    ErrorGain,
    Estimate,
    NamedCause,
    NextExperiment,
    OwnSpread,
    Unexplained,
    Verdict,
)
from rig.results.diagnosis import DiagnosisResult
from rig.results.diagnosis_lines import five_lines, next_sentence
from rig.results.diagnosis_tables import diagnosis_parts
from rig.results.tables import TextTable
from rig.trials.findings import Finding

FRICTION = NamedCause(
    ("friction", "backlash"), "the guide has a friction of 0.1 N", 0.9,
    {"friction_N": Estimate(0.1, 0.09, 0.11, unit="N")},
    ErrorGain(0.05, 0.03, 0.4, 0.3, 0.5), 1234.0, 0.01, "clean the guide", provisional=False, evidence_se_nats=100.0,
)  # fmt: skip
PROVISIONAL = replace(FRICTION, provisional=True)
SHARE = Estimate(0.998, 0.99, 1.0)


def result(verdict: Verdict = "explained", *findings: NamedCause, **more: object) -> DiagnosisResult:
    known: dict[str, object] = {
        "verdict": verdict, "statement": "It is so.", "simulation": "index", "session": "first", "recordings": 12,
        "findings": findings, "unexplained": Unexplained(("depth",), 0.001) if verdict == "unexplained" else None,
        "detectable": {}, "not_testable": {}, "next_experiment": None, "data_quality": (), "parameters": {},
        "simulation_error": (), "base_N": 0.05, "extended_N": 0.03, "floor_N": 0.029, "noise_N": 0.01,
        "explained_share": SHARE, "stiffness_N_mm": 0.5,
    }  # fmt: skip
    return DiagnosisResult.model_validate(known | more)


def lines(found: DiagnosisResult) -> dict[str, str]:
    return {name: text.strip() for name, _, text in (line.partition(":") for line in five_lines(found))}


def test_a_named_cause_is_told_with_share_size_cost_and_repair() -> None:
    said = lines(result("explained", FRICTION))
    assert list(said) == ["asked", "explained", "cause", "cost", "next"]
    assert said["asked"].startswith("does the index simulation predict the force of first (12 recordings)")
    assert said["explained"].startswith("100 % (99 to 100 %) of what any model tried could take off the error")
    assert said["cause"] == "the guide has a friction of 0.1 N (0.09 to 0.11 N, 95 %), or backlash"
    # sqrt(0.05^2 - 0.03^2) = 0.04 N, and 0.04 N / 0.5 N/mm = 0.08 mm
    assert said["cost"] == "a model without it gets the force wrong by 0.04 N rms, as much as 0.08 mm of depth"
    assert said["next"] == "clean the guide"


def test_a_share_of_all_beside_an_unexplained_rest_says_what_the_rest_is() -> None:
    gap = Finding("trial_001", "axis", "gap", "22 gaps")
    said = lines(result("unexplained", PROVISIONAL, data_quality=(gap,)))
    assert said["explained"].endswith("what is left is 3 times the noise and depends on depth; the data have gaps")
    assert said["cause"].startswith("no cause can be named for certain; the likeliest: the guide")
    assert "clean" not in said["next"]


def test_nothing_named_is_told_with_the_error_as_force_and_depth() -> None:
    said = lines(result("adequate", explained_share=None))
    assert said["cause"] == "no cause can be named"
    assert said["explained"].startswith("no model tried does better than the simulation as it is: the error is 0.03 N")
    assert said["cost"] == "the force is predicted within 0.03 N rms, as much as 0.06 mm of depth"
    assert said["next"].startswith("nothing to mend")
    spread = {"stiffness": OwnSpread(0.17, "1"), "touch": OwnSpread(0.14, "mm")}
    sites = lines(result("adequate", explained_share=None, scatter=spread))
    own = "from recording to recording it scatters by 17 % in stiffness, 0.14 mm in contact"
    assert sites["cost"] == f"the force is predicted within 0.03 N rms, as much as 0.06 mm of depth; {own}"
    assert lines(result("explained", FRICTION, scatter=spread))["cost"].endswith(own)
    flat = lines(result("adequate", explained_share=None, stiffness_N_mm=1e-5))
    assert flat["cost"] == "the force is predicted within 0.03 N rms", "3 m of depth are nobody's"


def test_an_axis_is_told_in_its_own_unit() -> None:
    gain = EffortGain(5.0, 3.0, "N m", 0.4, 0.3, 0.5)
    axis = AxisPrediction("closed loop", "N m", "rad", 4.69, Estimate(0.9, 0.8, 0.95))
    found = replace(FRICTION, effects=("coulomb_friction",), gain=gain)
    unknown = dict.fromkeys(("base_N", "extended_N", "explained_share"))
    said = lines(result("explained", found, simulation="axis", axis=axis, **unknown))
    assert "the effort of first (12 parts)" in said["asked"]
    assert said["cost"].startswith("without coulomb_friction the effort is wrong by 4 N m rms; ")
    assert said["cost"].endswith("left out is predicted to 4.69 %")


def test_the_share_of_an_axis_is_read_from_its_prediction() -> None:
    axis = AxisPrediction("closed loop", "N m", "rad", 4.69, Estimate(0.9, 0.8, 0.95))
    known = {key: value for key, value in dict(result("explained", FRICTION)).items() if key != "explained_share"}
    found = SimpleNamespace(**known | {"axis": axis, "budget": None})
    assert DiagnosisResult.model_validate(found).explained_share == axis.explained_share


def test_the_next_experiment_is_told_in_minutes() -> None:
    block = NextExperiment("5 cycles with a hold of 5 s", ("friction", "backlash"), 4.0)
    apart = "tells friction from backlash"
    assert next_sentence(block) == f"record 5 cycles with a hold of 5 s, repeated for 5 min, which {apart}"
    assert next_sentence(replace(block, nats_per_minute=0.001)) == f"no block of cycles {apart} within an hour"
    assert "repeated for 1 min" in next_sentence(replace(block, nats_per_minute=116162.8))


VERDICTS = ("adequate", "explained", "unexplained", "not judged")


@pytest.mark.parametrize(("verdict", "named"), product(VERDICTS, (False, True)))
def test_no_answer_speaks_of_nats(verdict: Verdict, named: bool) -> None:
    block = NextExperiment("5 cycles", ("a", "b"), 9.0)
    found = result(verdict, *([PROVISIONAL] if named else []), next_experiment=block)
    parts = list(diagnosis_parts(found))
    assert [str(part).partition(":")[0] for part in parts[:5]] == ["asked", "explained", "cause", "cost", "next"]
    told = [cell for part in parts if isinstance(part, TextTable) for row in [part.header, *part.rows] for cell in row]
    assert "nats" not in " ".join([*told, *(part for part in parts if isinstance(part, str))])
