"""The whole argument on made trials, with a block small enough for a test; what is printed and written of it."""

from pathlib import Path

import pytest

from api.operations.lattice import LatticeFit
from mock_devices.testing.made.synthetic import Bench
from rig.errors import DataError
from rig.tissue.control_table import control_rows
from rig.tissue.lattice.block import Block
from rig.tissue.lattice_study import LatticeStudy, lattice_study
from rig.tissue.study import Study, study_curves
from rig.trials.curves import loading_curve

BLOCK = Block((9, 9, 12), spacing_mm=2.0)


@pytest.fixture(scope="module")
def study() -> Study:
    cycles = Bench(depth_mm=6.0).cycles(trials=2, speeds_mm_s=(5.0, 10.0, 20.0))
    return study_curves("made", [loading_curve(cycle) for cycle in cycles])


@pytest.fixture(scope="module")
def found(study: Study) -> LatticeStudy:
    return lattice_study(study, BLOCK, search=False)


def test_the_index_lattice_beats_the_constant_one_on_fitted_and_left_out_trials(found: LatticeStudy) -> None:
    constant, index = found.judged["lattice constant"], found.judged["lattice index"]
    assert index.fitted.max_error_percent < 0.5 * constant.fitted.max_error_percent
    assert index.trials_left_out is not None
    assert constant.trials_left_out is not None
    assert index.trials_left_out.max_error_percent < 0.5 * constant.trials_left_out.max_error_percent


def test_alternatives_are_judged_on_the_same_curves(found: LatticeStudy) -> None:
    assert {"constant", "index", "quadratic", "power", "fung", "lattice constant", "lattice index"} <= set(found.judged)


def test_the_control_table_gives_tangent_above_secant_and_the_damping_that_was_put_in(found: LatticeStudy) -> None:
    for row in control_rows(found.judged["lattice index"], found.force_N):
        assert row.tangent_N_mm > row.secant_N_mm
        assert row.damping_N_s_mm == pytest.approx(0.01, abs=0.003)


def test_the_speed_test_finds_the_damping_that_was_put_in(study: Study) -> None:
    assert study.rate is not None
    assert study.rate.damping_N_s_mm == pytest.approx(0.01, abs=0.003)
    assert study.rate.excludes_study


def test_curves_deeper_than_the_block_are_refused_with_the_bound(study: Study) -> None:
    with pytest.raises(DataError, match=r"a block 5 mm high is simulated to 4.25 mm at most"):
        lattice_study(study, Block((9, 9, 6)))


def test_the_command_writes_picture_and_numbers(study: Study, tmp_path: Path) -> None:
    told: list[str] = []
    wanted = LatticeFit(BLOCK, stiffen=True)
    result = wanted(study, tmp_path, lambda stage, _: told.append(stage))
    assert len(set(told)) == wanted.stages
    assert (tmp_path / "lattice.png").read_bytes().startswith(b"\x89PNG")
    assert not list(tmp_path.glob("*.json"))  # it stands in fit.json
    written = result.model_dump(mode="json")
    for point in written["points"]:
        assert point["k_loop_N_mm"] == pytest.approx(point["k_exact_N_mm"], rel=0.01)
    assert written["models"]["lattice springs"]["parameters"]["b"]["value"] > 0.0
    agrees_to_mm = written["per_spring"]["agrees_to_mm"]
    assert agrees_to_mm > 4.0
    assert f"agrees with its quarter to {agrees_to_mm:.3g} mm only" in written["per_spring"]["doubt"]
