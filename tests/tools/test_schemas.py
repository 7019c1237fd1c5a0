"""The schemas in docs are those of the results, and every result that a command can return has one."""

import importlib
import pkgutil
from pathlib import Path

import rig.results
from rig.results.base import Result
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
    results = {kind for kind in _below(Result) - {Result} if kind.__name__.endswith("Result")}
    listed = {name for kind in WRITTEN.values() for name in (kind.__name__, *kind.model_json_schema().get("$defs", {}))}
    assert {kind.__name__ for kind in results} <= listed


def _below(kind: type[Result]) -> set[type[Result]]:
    return {kind, *(one for child in kind.__subclasses__() for one in _below(child))}
