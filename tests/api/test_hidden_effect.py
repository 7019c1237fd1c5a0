"""What the demonstration hides is physics of the mock bench, and its last sentence checks the name and every size."""

from collections.abc import Mapping
from dataclasses import replace

import numpy as np
import pytest

from api.cli.demo import PLAN
from api.cli.hidden_effect import BESIDE, CAUSES, HiddenCause, draw
from mock_devices.physics.effects import build, complete, knobs, parse_hidden
from mock_devices.physics.effects_tissue import ElasticLaw, Preconditioning, RateLaw, Substrate
from rig.diagnosis.design import check
from rig.diagnosis.effects.registry import CAUSES as LIBRARY
from rig.diagnosis.estimates import ErrorGain, Estimate, NamedCause, SmallestSize
from rig.diagnosis.problem import Par
from rig.results.diagnosis import DiagnosisResult

PARAMETERS: Mapping[str, Par] = {par.name: par for cause in LIBRARY.values() for par in cause.pars}
# No capture gets as far: force that grows in the air, by 0.03 N in 10 mm or by 0.02 N in a quarter of a magnet's pitch,
# is a touch to an approach, and the stroke that then feels nothing is stopped (2026-12-01).
NOT_HIDDEN = {"cross_talk", "cogging"}
PAIRS = ("ripple_mm", "motion_mm")  # the answer's size of a sine and a cosine
GAIN = ErrorGain(0.05, 0.01, 0.8, 0.7, 0.9)
SECRET = HiddenCause(
    "friction", {"level_N": 0.1, "slip_length_mm": 0.05}, {"friction_N": 0.1, "friction_length_mm": 0.05}
)


def named(effects: tuple[str, ...], sizes: Mapping[str, tuple[float, float]]) -> NamedCause:
    parameters = {name: Estimate((low + high) / 2, low, high) for name, (low, high) in sizes.items()}
    return NamedCause(effects, "it rubs", 0.9, parameters, GAIN, 100.0, 0.01, "clean it", provisional=False)


def answered(*findings: NamedCause, untested: Mapping[str, str] | None = None) -> DiagnosisResult:
    return DiagnosisResult(
        verdict="explained", statement="", simulation="index", session="s", recordings=10, findings=findings,
        unexplained=None, detectable={}, not_testable=untested or {}, next_experiment=None, data_quality=(),
        parameters={}, simulation_error=(),
    )  # fmt: skip


RIGHT = named(("friction",), {"friction_N": (0.09, 0.11), "friction_length_mm": (0.04, 0.06)})


@pytest.mark.parametrize("effect", CAUSES)
def test_every_cause_is_one_of_the_mock_bench_and_of_the_library(effect: str) -> None:
    for number in CAUSES[effect]:
        bounds = knobs(effect)[number.knob]
        assert bounds.low <= number.low < number.high <= bounds.high
        if number.parameter != "damping_N_s_mm" and not number.parameter.endswith(PAIRS):
            assert PARAMETERS[number.parameter].null == number.null or number is not CAUSES[effect][0]
    assert set(BESIDE.get(effect, {})) <= set(knobs(effect))


def test_sizes_in_an_answer_are_what_the_mock_benchs_physics_makes_of_its_knobs() -> None:
    told = {effect: [number.told for number in numbers] for effect, numbers in CAUSES.items()}
    substrate = Substrate(strength=0.2)
    assert substrate(4.0, 0.0) == pytest.approx(1 + told["substrate"][0](0.2) * 4.0**3)
    assert RateLaw(0.5, 0.1)(10.0, 0.0) == pytest.approx(10.0 * told["rate_law"][1](0.1))
    power = ElasticLaw(exponent=1.8)
    assert power(float, 6.0) / power(float, 3.0) == pytest.approx(2 ** told["elastic_law"][0](1.8))
    hidden = parse_hidden(HiddenCause("preconditioning", {"softening": 0.2}).hide)
    worn = build("preconditioning", complete(hidden)["preconditioning"])
    assert isinstance(worn, Preconditioning)
    first, last = worn(2.0, 0.0), 1.0 - worn.softening
    assert first / last - 1 == pytest.approx(told["preconditioning"][0](0.2))


def test_whatever_the_demonstrations_own_plan_can_show_is_hidden_in_some_demonstration() -> None:
    visible = check(PLAN).detectable
    assert {draw(np.random.default_rng(seed), visible).effect for seed in range(400)} == visible.keys() - NOT_HIDDEN


def test_all_that_is_visible_is_drawn_and_no_smaller_than_three_times_what_shows() -> None:
    visible = {name: SmallestSize(0.02, "N") for name in ("friction", "adhesion", "gain_error")}
    visible["backlash"] = SmallestSize(0.05, "mm")
    drawn = [draw(np.random.default_rng(seed), visible) for seed in range(40)]
    assert {one.effect for one in drawn} == {"friction", "adhesion"}
    assert min(one.knobs["level_N"] for one in drawn) >= 0.06
    parse_hidden(option for one in drawn for option in one.hide)


def test_the_last_sentence_says_when_name_and_every_size_are_right() -> None:
    said = SECRET.sentence(answered(RIGHT))
    assert said.endswith("name and every size are right.") and said.count("holds") == 2
    assert SECRET.inside(answered(RIGHT)) == {"friction_N": True, "friction_length_mm": True}


@pytest.mark.parametrize(
    ("answer", "says"),
    [
        (answered(replace(RIGHT, parameters={**RIGHT.parameters, "friction_length_mm": Estimate(0.07, 0.06, 0.08)})),
         "friction_length_mm 0.07, whose interval 0.06 to 0.08 misses 0.05"),
        (answered(named(("backlash", "friction"), {"backlash_mm": (0.1, 0.2)})), "friction_N = 0.1 was not found"),
        (answered(RIGHT, named(("adhesion",), {})), "it also named adhesion, which was not hidden"),
        (answered(), "the diagnosis did not find it; "),
        (answered(untested={"friction": "it never turned"}), "which it could not test: it never turned"),
    ],
)  # fmt: skip
def test_whatever_is_not_right_is_said(answer: DiagnosisResult, says: str) -> None:
    said = SECRET.sentence(answer)
    assert says in said and said.endswith("not all of it was found.")
