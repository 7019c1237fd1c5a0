"""Each number of `make metrics` on sources in which what it counts was planted."""

import json
import sys
from pathlib import Path

import grimp
import pytest

from tools import metrics
from tools.counted_apart import APART
from tools.metrics import Source

HEAD = "from collections.abc import Mapping\nfrom typing import Any\n"


def source(path: str, text: str) -> Source:
    return Source(path, text)


def test_a_class_defined_twice_is_named_unless_the_glossary_says_why() -> None:
    sources = [
        source("rig/a.py", "class One: pass\nclass Two: pass"),
        source("api/b.py", "class Two:\n class Inner: pass"),
    ]
    assert metrics.class_names_twice(sources) == ["Two"]
    assert metrics.class_names_twice(sources, "text\n\n`Two` (class)\n: one is a product\n") == []


@pytest.mark.parametrize(
    "definition",
    [
        "def shown(found: dict[str, Any]) -> None: ...",
        "def shown() -> Mapping[str, object]: ...",
        "class shown:\n    found: list[dict[str, object]]",
        "class shown:\n    def method(self, *, found: dict[str, Any]) -> None: ...",
    ],
)
def test_an_untyped_dictionary_counts_where_another_package_imports_it(definition: str) -> None:
    defined = source("rig/results/a.py", HEAD + definition)
    assert metrics.untyped_dicts([defined]) == []
    beside = source("rig/results/b.py", "from rig.results.a import shown")
    assert metrics.untyped_dicts([defined, beside]) == []
    for line in ("from rig.results.a import shown", "from rig.results import a\na.shown()"):
        [found] = metrics.untyped_dicts([defined, source("rig/report/b.py", line)])
        assert found.startswith("rig.results.a:shown")


@pytest.mark.parametrize(
    "definition",
    [
        "def shown() -> dict[str, float]: ...",
        "def _shown() -> dict[str, Any]: ...",
        "class shown:\n    _a: dict[str, Any]",
    ],
)
def test_what_is_typed_or_private_does_not_count(definition: str) -> None:
    sources = [source("rig/results/a.py", HEAD + definition), source("api/b.py", "from rig.results.a import shown")]
    assert metrics.untyped_dicts(sources) == []


def test_functions_are_measured_from_def_to_end() -> None:
    text = "@decorated\ndef three():\n    '''Text.'''\n    return 1\n\nasync def two():\n    return 2\n"
    assert metrics.function_lengths([source("a.py", text)]) == [2, 3]


@pytest.mark.parametrize(
    ("text", "found"),
    [
        ("LIMIT_N = 3.0\ndef f(x): return x > LIMIT_N", {"LIMIT_N": False}),
        ("LIMIT_N = 3.0  # a nail bends at 4\ndef f(x): return x > LIMIT_N", {"LIMIT_N": True}),
        ("# A nail bends at 4.\nLIMIT_N = 3.0\ndef f(x): return min(x, LIMIT_N)", {"LIMIT_N": True}),
        ("# Both.\nLOW, HIGH = -1, 2**3\nOTHER = 1\ndef f(x): return LOW < x < HIGH", {"LOW": True, "HIGH": True}),
        ('LIMIT = 3\n"""A nail bends at 4."""\ndef f(x): return x > LIMIT', {"LIMIT": True}),
        ("# A nail.\nNAIL_N = 4\nLIMIT_N = 3\ndef f(x): return x > LIMIT_N", {"LIMIT_N": True}),
        ("# A nail.\nNAIL_N = 4\nSHOE_N = 4\nLIMIT_N = 3\ndef f(x): return x > LIMIT_N", {"LIMIT_N": False}),
        ("# A nail.\nNAIL_N = 4  # bends\nLIMIT_N = 3\ndef f(x): return x > LIMIT_N", {"LIMIT_N": False}),
        ("ANSWER_TIMEOUT_S = 3\nANSWER_S = 3\nMINUTES = 3", {"ANSWER_TIMEOUT_S": False}),
        ("LIMIT_N_m = 3\ndef f(x): return x > LIMIT_N_m", {"LIMIT_N_m": False}),
        ("Limit = 3\nlimit = 4\ndef f(x): return limit > x > Limit", {}),
        ("# Far away.\nNAME = 'a'\n\nLIMIT = 3\ndef f(x): return x > LIMIT", {"LIMIT": False}),
        ("CODE = 3\ndef f(x): return x == CODE", {}),
        ("TABLE = [3]\ndef f(x): return x > TABLE[0]", {}),
    ],
)
def test_a_threshold_is_a_number_something_is_compared_with(text: str, found: dict[str, bool]) -> None:
    assert metrics.thresholds([source("a.py", text)]) == {f"a:{name}": has for name, has in found.items()}


def test_a_threshold_compared_with_in_another_file_counts_where_it_stands() -> None:
    sources = [source("a.py", "LIMIT = 3\n"), source("b.py", "import a\ndef f(x): return x > a.LIMIT")]
    assert metrics.thresholds(sources) == {"a:LIMIT": False}


def test_an_upward_import_and_a_cycle_are_named(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    package = tmp_path / "planted"
    (package / "low").mkdir(parents=True)
    (package / "high.py").write_text("from planted import low\n")
    (package / "alone.py").write_text("import planted.high\n")
    (package / "low" / "__init__.py").write_text("")
    (package / "low" / "inner.py").write_text("from planted import high\nfrom planted.low import other\n")
    (package / "low" / "other.py").write_text("def late():\n    import planted.low.inner\n")
    (package / "__init__.py").write_text("")
    monkeypatch.syspath_prepend(str(tmp_path))
    graph = grimp.build_graph("planted", cache_dir=None)
    contract: dict[str, list[str] | str] = {"containers": ["planted"], "layers": ["alone", "high", "low"]}
    assert metrics.upward_imports(graph, [contract]) == ["planted.low.inner -> planted.high"]
    assert metrics.cycles(graph) == [["planted.low.inner", "planted.low.other"]]
    sys.modules.pop("planted", None)


def test_no_number_falls_back() -> None:
    numbers, lists = metrics.measured(metrics.ROOT)
    assert numbers.keys() == metrics.GOALS.keys()
    fallen = metrics.fallen(numbers)
    assert not fallen, [(name, numbers[name], lists.get(name)) for name in fallen]


BETTER = {
    "class_names_twice": 0, "untyped_dicts": 9, "upward_imports": 0, "cycles": 0, "source_lines": metrics.MOST_LINES,
    "source_lines_safety": 8220, "source_lines_data": 8585, "source_lines_criticism": 2410,
    "source_lines_service": 10295, "source_lines_devices": 10935, "source_lines_law": 2235, "source_lines_scale": 2500,
    "function_median": 6, "function_p90": 20, "file_max": 400, "test_to_source": 0.8,
    "thresholds_with_reason": 0.9,
}  # fmt: skip


@pytest.mark.parametrize("name", metrics.GOALS)
def test_a_number_that_falls_back_is_named(name: str) -> None:
    assert metrics.fallen(BETTER) == []
    worse = -0.01 if name in ("test_to_source", "thresholds_with_reason") else 1
    assert metrics.fallen(BETTER | {name: BETTER[name] + worse}) == [name]


def test_whoever_runs_it_sees_each_number_beside_its_goal_and_how_it_ended(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setattr(sys, "argv", ["metrics", "--list"])
    for numbers, code in ((BETTER, 0), (BETTER | {"cycles": 2}, 1)):
        monkeypatch.setattr(metrics, "measured", lambda _, numbers=numbers: (numbers, {"cycles": ["a <-> b"]}))
        with pytest.raises(SystemExit) as ended:
            metrics.main()
        assert ended.value.code == code
        told = capsys.readouterr().out
        assert json.loads(told.splitlines()[-1]) == numbers
        assert "at least 0.8" in told
        assert "a <-> b" in told


def test_what_came_later_is_counted_apart_by_folders_and_files_that_exist_and_once() -> None:
    assert metrics.is_apart("controller/stop/word.py")
    assert metrics.is_apart("rig/intake/text.py")
    assert not metrics.is_apart("rig/trials/curves.py")
    paths = [path for entries in APART.values() for path in entries]
    assert [path for path in paths if not (metrics.ROOT / path).exists()] == []
    assert len(paths) == len(set(paths))


def test_a_goal_is_reached_from_the_side_it_names() -> None:
    assert metrics.reached("file_max", 400)
    assert not metrics.reached("file_max", 401)
    assert not metrics.reached("test_to_source", 0.79)
