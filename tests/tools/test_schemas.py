"""The schemas in docs are those of the results, and every result that a command can return has one."""

import importlib
import pkgutil
from pathlib import Path

import rig.results
from rig.results.base import SavedResult
from tools.schemas import WRITTEN, main, schemas

DOCS = Path(__file__).parents[2] / "docs" / "reference" / "schemas"


def test_the_schemas_in_docs_are_current() -> None:
    written = {path.name: path.read_text() for path in DOCS.glob("*.json")}
    assert written == schemas(), "run: python -m tools.schemas docs/reference/schemas"


def test_the_command_takes_away_what_is_no_longer_a_result(tmp_path: Path) -> None:
    (tmp_path / "old.schema.json").write_text("{}")
    main(tmp_path)
    assert {path.name for path in tmp_path.iterdir()} == set(schemas())


def test_every_result_of_a_command_has_a_schema() -> None:
    for module in pkgutil.iter_modules(rig.results.__path__):
        importlib.import_module(f"rig.results.{module.name}")
    saved = {kind for kind in _below(SavedResult) - {SavedResult} if kind.__module__.startswith("rig.results.")}
    assert saved == set(WRITTEN.values())


def _below(kind: type[SavedResult]) -> set[type[SavedResult]]:
    return {kind, *(one for child in kind.__subclasses__() for one in _below(child))}
