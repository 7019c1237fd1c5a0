"""Every command has a route, or a reason why it has none; every route, view and command that is named is there."""

import re
from pathlib import Path

import pytest

from api.cli.app import COMMANDS
from api.http.jobs.kinds import KINDS
from tools import parity
from tools.reference import fill

ROOT = Path(__file__).parents[2]
VIEWS = ROOT / "api" / "page" / "sources" / "src" / "views" / "index.ts"


def lacking(rows: list[parity.Row]) -> list[str]:
    """Commands with neither route nor reason, or with both."""
    return [row.command for row in rows if bool(row.routes) == bool(row.reason)]


def unshown(rows: list[parity.Row]) -> list[str]:
    """Commands that have a route, and neither a view nor a reason for none, or both."""
    return [row.command for row in rows if row.routes and bool(row.view) == bool(row.unseen)]


def test_every_command_with_a_route_has_a_view_or_a_reason_for_none(monkeypatch: pytest.MonkeyPatch) -> None:
    assert unshown(parity.rows()) == []
    assert set(parity.UNSEEN) <= {row.command for row in parity.rows() if row.routes}
    monkeypatch.delitem(parity.UNSEEN, "repair")
    monkeypatch.setitem(parity.UNSEEN, "fit", "planted")
    assert unshown(parity.rows()) == ["fit", "repair"]


def test_every_command_has_a_route_or_a_reason() -> None:
    names = list(parity.commands())
    assert {"fit", "subject erase", "calibrate force", "protocol check", "token create"} <= set(names)
    assert len(names) == len(set(names)) > 40
    assert lacking(parity.rows()) == []


def test_a_command_without_either_is_found(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(COMMANDS, "planted", "api.cli.hardware:mock")
    assert lacking(parity.rows()) == ["planted"]
    monkeypatch.setattr(
        "tools.parity.KINDS", {name: kind for name, kind in KINDS.items() if not name.startswith("fit")}
    )
    assert set(lacking(parity.rows())) == {"planted", "fit"}
    monkeypatch.setattr("tools.parity.KINDS", {name: KINDS[name] for name in KINDS if name != "calibrate-glove"})
    assert lacking(parity.rows()) == ["calibrate glove", "planted"], "no other calibration's route stands in for it"


def test_every_route_that_is_named_is_there() -> None:
    named = {route.partition(", kind")[0] for row in parity.rows() for route in row.routes}
    assert named - parity.operations() == set()
    assert set(parity.ROUTES) | set(parity.WITHOUT) <= set(parity.commands())


def test_every_view_that_is_named_is_there() -> None:
    views = set(re.findall(r"(\w+): [A-Z]\w+", VIEWS.read_text()))
    rows = parity.rows()
    assert {row.view for row in rows} - {""} <= views
    named = re.findall(r'^  "([^"]+)": ', parity.VIEWS.read_text(), re.MULTILINE)
    assert set(named) <= set(parity.commands()) and len(named) == len(set(named))


def test_the_table_stands_in_the_reference() -> None:
    text = fill("<!-- generated: parity -->")
    assert "| `rig fit` | `POST /jobs, kind fit`, `POST /jobs, kind fit-cohort` | session |" in text
    assert "| `rig calibrate axis` | `POST /jobs, kind calibrate-axis` | devices |" in text
    assert "| `rig calibrate glove` | `POST /jobs, kind calibrate-glove` | devices |" in text
    assert "| `rig serve` | none: is the service itself | none |" in text
    assert "| `rig catalogue sites` | `GET /sites` | none: each subject shows its own |" in text
    assert text.count("\n| `rig ") == len(list(parity.commands()))


def unexplained() -> list[str]:
    """Routes with neither a command nor a reason for none, or with both."""
    return [route for route, commands in parity.by_route().items() if bool(commands) == (route in parity.ALONE)]


def test_every_route_has_a_command_or_a_reason_for_none(monkeypatch: pytest.MonkeyPatch) -> None:
    assert unexplained() == []
    assert set(parity.ALONE) <= parity.operations() and all(parity.ALONE.values())
    there = parity.operations()
    monkeypatch.setattr(parity, "operations", lambda: {*there, "GET /planted"})
    monkeypatch.delitem(parity.ALONE, "GET /rig")
    monkeypatch.setitem(parity.ALONE, "GET /devices", "planted")
    assert unexplained() == ["GET /devices", "GET /planted", "GET /rig"]


def test_the_table_of_routes_stands_in_the_reference() -> None:
    text = fill("<!-- generated: parity-of-routes -->")
    assert "| `POST /recover` | `rig reset` |" in text
    assert "| `GET /info` | none: says who the service is |" in text
    assert "`rig fit`" in next(line for line in text.splitlines() if line.startswith("| `POST /jobs` |"))
    assert text.count("\n| `") == len(parity.operations())
    assert "<!-- generated: parity-of-routes -->" in (ROOT / "docs" / "reference" / "parity.md").read_text()
