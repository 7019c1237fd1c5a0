"""`model.json`: what is written is what is read, and a file that is not one is refused in one sentence."""

import json
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from rig.errors import DataError, UsageError, WriteFailed
from rig.tissue.laws import Index, Law
from rig.tissue.model import Model, Provenance, Quality, ValidRange, load_model
from tests.rig.tissue.examples import EXAMPLES

MODEL = Model(
    law=Index(a_N_mm=0.12, b_per_mm=0.22, damping_N_s_mm=0.01),
    covariance=np.diag([1e-6, 4e-6, 9e-8]),
    intervals={"a_N_mm": (0.118, 0.122), "b_per_mm": (0.216, 0.224), "damping_N_s_mm": (0.0094, 0.0106)},
    interval_level=0.95,
    interval_method="jackknife over trials",
    valid=ValidRange(depth_mm=8.0, force_N=5.6, speeds_mm_s=(5.0, 30.0)),
    data=Provenance(session="first", trials=("trial_001", "trial_002"), sha256="0" * 64, subject="7", site="forearm"),
    quality=Quality(rmse_N=0.01, max_error_mm=0.03, max_error_percent=1.9, held_out_max_error_mm=0.04),
)


@pytest.fixture
def file(tmp_path: Path) -> Path:
    """The model on disk."""
    path = tmp_path / "model.json"
    MODEL.save(path)
    return path


def test_a_model_survives_its_file(file: Path) -> None:
    read = load_model(file)
    assert read.law == MODEL.law
    assert read.covariance == pytest.approx(MODEL.covariance)
    assert (read.intervals, read.valid, read.data, read.quality) == (
        MODEL.intervals, MODEL.valid, MODEL.data, MODEL.quality
    )  # fmt: skip
    assert read.standard_errors == pytest.approx({"a_N_mm": 1e-3, "b_per_mm": 2e-3, "damping_N_s_mm": 3e-4})


@pytest.mark.parametrize("law", EXAMPLES, ids=[law.name for law in EXAMPLES])
def test_a_model_of_any_law_survives_its_file(law: Law, tmp_path: Path) -> None:
    intervals = {p.name: (p.value, p.value) for p in law.parameters}
    covariance = np.diag(np.arange(len(law.bounds)) * 1e-6)
    replace(MODEL, law=law, covariance=covariance, intervals=intervals).save(tmp_path / "model.json")
    read = load_model(tmp_path / "model.json")
    assert read.law == law
    assert read.force_N(4.0) == pytest.approx(float(law.force(4.0)))
    assert read.tangent_N_mm(4.0) == pytest.approx(float(law.tangent_stiffness(4.0)))
    assert read.damping_N_s_mm == pytest.approx(float(law.damping(np.array(4.0))))


def test_a_model_answers_what_a_controller_asks() -> None:
    assert MODEL.tangent_N_mm(0.0) == pytest.approx(0.12)
    assert MODEL.force_N(5.0) == pytest.approx(0.6 * np.exp(1.1))
    assert MODEL.depth_mm(MODEL.force_N(5.0)) == pytest.approx(5.0)
    assert MODEL.damping_N_s_mm == 0.01


def test_a_force_beyond_the_fitted_range_is_refused_with_that_range() -> None:
    MODEL.check_force(5.6)
    with pytest.raises(DataError, match=r"12 N is outside what the model was fitted to, 0 to 5.6 N .*8 mm"):
        MODEL.check_force(12.0)
    with pytest.raises(DataError, match=r"-1 N is outside"):
        MODEL.check_force(-1.0)
    with pytest.raises(DataError, match=r"nan N is outside"):
        MODEL.check_force(float("nan"))


@pytest.mark.parametrize(
    ("fitted_percent", "held_out_percent"), [(1.9, 155.0), (662.0, None), (51.0, None), (1.9, 50.1)]
)
def test_a_law_off_by_more_than_a_loop_can_hold_is_none_to_track_with(
    fitted_percent: float, held_out_percent: float | None
) -> None:
    errors = {"max_error_percent": fitted_percent, "held_out_max_error_percent": held_out_percent}
    poor = replace(MODEL, quality=MODEL.quality.model_copy(update=errors))
    worst = held_out_percent or fitted_percent
    with pytest.raises(DataError, match=rf"the index law errs by up to {worst:.0f} % .*none to track with; `rig diagn"):
        poor.check_force(1.0)


def test_a_law_off_by_as_much_as_a_loop_can_hold_is_tracked_with() -> None:
    replace(MODEL, quality=MODEL.quality.model_copy(update={"held_out_max_error_percent": 50.0})).check_force(1.0)


def test_the_file_says_units_and_formula_for_readers_without_this_program(file: Path) -> None:
    values = json.loads(file.read_text())
    assert values["formula"] == "F = a x exp(b x) + B v"
    assert values["units"] == {"a_N_mm": "N/mm", "b_per_mm": "1/mm", "damping_N_s_mm": "N s/mm"}
    assert (values["format"], values["version"]) == ("tissue-rig model", 2)


VERSION_1 = Path(__file__).parent / "version_1"
NAMES_OF_VERSION_1 = {
    "index": "a_N_mm b_per_mm damping_N_s_mm",
    "hunt_crossley": "a_N_mmn exponent lambda_N_s_mmn1",
    "qlv": "A_N b_per_mm relaxation_ratio tau_s",
    "extended": "a_N_mm b_per_mm damping_N_s_mm exponent quadratic_per_mm substrate_per_mm3 relaxation_ratio tau_s "
    "frame_compliance_mm_N friction_N friction_length_mm",
}


@pytest.mark.parametrize("law", NAMES_OF_VERSION_1)
def test_a_model_of_version_1_is_read_with_the_names_of_today(law: str, tmp_path: Path) -> None:
    path, names = VERSION_1 / f"{law}.json", NAMES_OF_VERSION_1[law].split()
    kept, model = json.loads(path.read_text()), load_model(path)
    # What the law has learnt since is off.
    later = {name: float(getattr(type(model.law), name)) for name in model.law.later}
    known = dict(zip(names, kept["parameters"].values(), strict=True))
    assert {p.name: p.value for p in model.law.parameters} == known | later
    assert [p.unit for p in model.law.parameters][: len(names)] == list(kept["units"].values())
    stated = [tuple(interval) for interval in kept["intervals"].values()]
    assert list(model.intervals.values()) == [*stated, *((value, value) for value in later.values())]
    errors = dict(zip(names, kept["standard_errors"].values(), strict=True))
    assert model.standard_errors == pytest.approx(errors | dict.fromkeys(later, 0.0))
    model.save(tmp_path / "model.json")
    assert json.loads((tmp_path / "model.json").read_text())["version"] == 2
    assert load_model(tmp_path / "model.json").law == model.law


def test_what_a_diagnosis_of_version_1_named_has_the_names_of_today_too() -> None:
    (effect,) = load_model(VERSION_1 / "extended.json").effects
    assert {name: value.unit for name, value in effect.parameters.items()} == {"relaxation_ratio": "1", "tau_s": "s"}


def test_version_2_does_not_know_the_names_of_version_1(tmp_path: Path) -> None:
    values = json.loads((VERSION_1 / "index.json").read_text()) | {"version": 2}
    (tmp_path / "model.json").write_text(json.dumps(values))
    with pytest.raises(UsageError, match="parameters of the index law are a_N_mm, b_per_mm, damping_N_s_mm; the file"):
        load_model(tmp_path / "model.json")


def test_a_failed_write_leaves_no_half_file(tmp_path: Path) -> None:
    with pytest.raises(WriteFailed):
        MODEL.save(tmp_path / "missing" / "model.json")
    assert list(tmp_path.iterdir()) == []


Edit = Callable[[dict[str, Any]], object]
BAD: list[tuple[str, Edit, str]] = [
    ("unknown key", lambda v: v.update(quallity={}), r"unknown key quallity; nearest valid key: quality"),
    (
        "unknown inner key",
        lambda v: v["valid"].update(depth=3),
        r"unknown key valid.depth; nearest valid key: depth_mm",
    ),
    ("other format", lambda v: v.update(format="recipe"), r"is not a tissue model"),
    (
        "other version",
        lambda v: v.update(version=3),
        r"format version 3 is newer than 2, which this program reads",
    ),
    ("no version", lambda v: v.pop("version"), r"states no version of its format, 1 or 2"),
    ("unknown law", lambda v: v.update(law="cubic"), r"unknown tissue law 'cubic'"),
    (
        "missing parameter",
        lambda v: v["parameters"].pop("a_N_mm"),
        r"parameters of the index law are a_N_mm, .*the file",
    ),
    ("extra parameter", lambda v: v["intervals"].update(c=[0, 1]), r"intervals of the index law are"),
    ("wrong unit", lambda v: v["units"].update(a_N_mm="N/m"), r"a_N_mm must be in N/mm; the file has it in 'N/m'"),
    ("bad value", lambda v: v["parameters"].update(a_N_mm=-3), r"a_N_mm = -3 N/mm is outside"),
    ("NaN", lambda v: v["parameters"].update(a_N_mm=float("nan")), r"parameters.a_N_mm: .*finite"),
    ("no range", lambda v: v.pop("valid"), r"valid: Field required"),
    ("empty range", lambda v: v["valid"].update(force_N=0), r"valid.force_N: .*greater than 0"),
    ("no data id", lambda v: v["data"].update(sha256="abc"), r"data.sha256"),
    ("small covariance", lambda v: v.update(covariance=[[1.0]]), r"covariance must be 3 x 3"),
    ("lopsided covariance", lambda v: v["covariance"][0].__setitem__(1, 5.0), r"symmetric"),
    ("negative variance", lambda v: v["covariance"][0].__setitem__(0, -1.0), r"diagonal of at least 0"),
]


@pytest.mark.parametrize(("edit", "says"), [(edit, says) for _, edit, says in BAD], ids=[name for name, _, _ in BAD])
def test_a_file_that_is_no_model_is_refused_in_one_sentence(file: Path, edit: Edit, says: str) -> None:
    values = json.loads(file.read_text())
    edit(values)
    file.write_text(json.dumps(values))
    with pytest.raises(UsageError, match=says) as caught:
        load_model(file)
    assert str(file) in str(caught.value)


@pytest.mark.parametrize("content", [b"", b"{", b"\xff\xfe", b"[1, 2]", b"null"])
def test_other_content_is_refused_with_the_files_name(tmp_path: Path, content: bytes) -> None:
    path = tmp_path / "model.json"
    path.write_bytes(content)
    with pytest.raises(UsageError, match=str(path)):
        load_model(path)


def test_a_missing_file_says_what_writes_one(tmp_path: Path) -> None:
    with pytest.raises(UsageError, match=r"no such file; `rig fit SESSION` writes a model.json"):
        load_model(tmp_path / "model.json")
