"""Stiffness over sessions: one depth for a site, against laws worked out by hand."""

import math

import pytest

from api.catalogue.stiffness import compared
from rig.results.catalogue import ModelEntry, SessionEntry


def model(
    session: str,
    law: str,
    depth_mm: float | None,
    parameters: dict[str, float],
    site: str = "forearm",
    file: str = "fit/model.json",
) -> ModelEntry:
    return ModelEntry(
        key=f"{session}/{file}",
        session=session,
        at="2026-11-23T00:00:00Z",
        site=site,
        file=file,
        law=law,
        parameters=parameters,
        rmse_N=0.1,
        depth_mm=depth_mm,
    )


def recorded(name: str, day: int) -> SessionEntry:
    return SessionEntry(key=name, session=name, at=f"2026-11-{day:02d}T10:00:00Z")


LINE = {"k_N_mm": 0.5, "damping_N_s_mm": 0.02}
INDEX = {"a_N_mm": 0.2, "b_per_mm": 0.1, "damping_N_s_mm": 0.02}


def test_all_sessions_of_a_site_are_compared_at_the_least_depth_that_their_models_cover() -> None:
    sessions = [recorded("early", 1), recorded("late", 9)]
    found = compared(sessions, [model("late", "constant", 6.0, LINE), model("early", "index", 9.0, INDEX)])
    assert [entry.session for entry in found] == ["late", "early"]
    assert {entry.depth_mm for entry in found} == {6.0}
    assert found[0].stiffness_N_mm == pytest.approx(0.5)
    assert found[1].stiffness_N_mm == pytest.approx(0.2 * math.exp(0.1 * 6.0))


def test_sites_are_not_compared_with_each_other_and_a_diagnosis_s_model_is_left_out() -> None:
    found = compared(
        [recorded("a", 1), recorded("b", 2)],
        [
            model("a", "index", 9.0, INDEX),
            model("b", "index", 4.0, INDEX, site="calf"),
            model("a", "index", 2.0, INDEX, file="diagnosis/model.json"),
        ],
    )
    assert {entry.session: entry.depth_mm for entry in found} == {"a": 9.0, "b": 4.0}


def test_a_law_that_is_not_known_here_and_a_model_without_a_depth_are_left_out() -> None:
    models = [
        model("a", "no such law", 9.0, {"x": 1.0}),
        model("b", "constant", None, LINE),
        model("c", "constant", 5.0, LINE),
    ]
    assert [entry.session for entry in compared([], models)] == ["c"]
