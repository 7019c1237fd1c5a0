"""Code kept on disk is the code that would be compiled: whatever it is made from changes, and whoever else writes."""

import importlib.util
import os
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path
from types import ModuleType
from typing import Any

import pytest

from controller.simulated import segments
from rig.machine_code import code_folder, compiled

SOURCE = """
from typing import NamedTuple

SCALE = 3.0

class Pair(NamedTuple):
    low: float
    high: float

def inner(x):
    return x + 1

def outer(x):
    return SCALE * inner(x)

def first(pair):
    return pair.low

def listed(x):
    return x + LIST[0]

LIST = [1.0]
"""
AGED_NS = 1_000_000_000


@pytest.fixture(autouse=True)
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.setenv("NUMBA_CACHE_DIR", str(tmp_path / "kept"))
    return tmp_path / "kept" / "tissue-rig" / "code"


def module(path: Path, source: str = SOURCE, name: str = "kept_source") -> ModuleType:
    """A module of ``source``, of the same age whatever is in it."""
    path.write_text(source)
    os.utime(path, ns=(AGED_NS, AGED_NS))
    spec = importlib.util.spec_from_loader(name, None, origin=str(path))
    assert spec
    made = importlib.util.module_from_spec(spec)
    made.__file__ = str(path)
    sys.modules[name] = made
    exec(compile(source, path, "exec"), vars(made))
    return made


def was_loaded(function: Any) -> bool:
    """Whether all of its code came from the disk."""
    return bool(function.stats.cache_hits) and not function.stats.cache_misses


def outer(made: ModuleType) -> Callable[[float], float]:
    function: Callable[[float], float] = compiled(made.outer, {"inner": compiled(made.inner)})
    return function


def test_a_second_binding_of_the_same_functions_loads_its_code_and_gives_the_same(tmp_path: Path) -> None:
    made = module(tmp_path / "source.py")
    first, second = outer(made), outer(made)
    assert (first(1.0), second(1.0)) == (6.0, 6.0)
    assert not was_loaded(first)
    assert was_loaded(second)


def test_one_function_bound_to_another_is_other_code(tmp_path: Path) -> None:
    made = module(tmp_path / "source.py")
    assert outer(made)(1.0) == 6.0
    other = module(tmp_path / "other.py", SOURCE.replace("x + 1", "x - 1"), "kept_other")
    bound: Any = compiled(made.outer, {"inner": compiled(other.inner)})
    assert bound(1.0) == 0.0
    assert not was_loaded(bound)


@pytest.mark.parametrize(("was", "becomes", "answer"), [("x + 1", "x - 1", 0.0), ("SCALE = 3.0", "SCALE = 5.0", 10.0)])
def test_a_source_changed_at_the_same_age_and_size_is_compiled_again(
    tmp_path: Path, was: str, becomes: str, answer: float
) -> None:
    assert outer(module(tmp_path / "source.py"))(1.0) == 6.0
    assert outer(module(tmp_path / "source.py", SOURCE.replace(was, becomes)))(1.0) == answer


def test_a_constant_set_from_outside_is_other_code(tmp_path: Path) -> None:
    made = module(tmp_path / "source.py")
    assert outer(made)(1.0) == 6.0
    vars(made)["SCALE"] = 4.0
    assert outer(made)(1.0) == 8.0


def test_an_argument_with_its_fields_in_another_order_is_other_code(tmp_path: Path) -> None:
    made = module(tmp_path / "source.py")
    turned = module(
        tmp_path / "turned.py",
        "from typing import NamedTuple\nclass Pair(NamedTuple):\n    high: float\n    low: float\n",
        "kept_turned",
    )
    turned.Pair.__module__ = "kept_source"  # as if its file had been edited in between
    first: Any = compiled(made.first)
    assert first(made.Pair(low=1.0, high=2.0)) == 1.0
    vars(made)["Pair"] = turned.Pair
    again: Any = compiled(made.first)
    assert again(turned.Pair(low=1.0, high=2.0)) == 1.0


def test_code_that_names_what_may_change_is_refused(tmp_path: Path) -> None:
    with pytest.raises(TypeError, match="names a list"):
        compiled(module(tmp_path / "source.py").listed)


@pytest.mark.parametrize(
    "damage", [lambda kept: kept[:-9], lambda kept: kept[:60] + b"\xff" + kept[61:], lambda _: b""]
)
def test_a_damaged_file_is_compiled_again_and_mended(
    tmp_path: Path, folder: Path, damage: Callable[[bytes], bytes]
) -> None:
    made = module(tmp_path / "source.py")
    assert outer(made)(1.0) == 6.0
    for file in folder.iterdir():
        file.write_bytes(damage(file.read_bytes()))
    second, third = outer(made), outer(made)
    assert (second(1.0), third(1.0)) == (6.0, 6.0)
    assert not was_loaded(second)
    assert was_loaded(third)


def test_a_folder_that_cannot_be_written_keeps_nothing(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("NUMBA_CACHE_DIR", os.devnull)
    assert outer(module(tmp_path / "source.py"))(1.0) == 6.0


def test_without_a_place_named_the_code_is_kept_where_caches_are(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.delenv("NUMBA_CACHE_DIR")
    monkeypatch.setenv("XDG_CACHE_HOME", "/var/cache/someone")
    assert code_folder() == Path("/var/cache/someone/tissue-rig")
    monkeypatch.delenv("XDG_CACHE_HOME")
    assert code_folder() == Path.home() / ".cache" / "tissue-rig"


MEETING = """
import sys
from rig.machine_code import compiled
sys.path.insert(0, sys.argv[1])
import kept_source as made
function = compiled(made.outer, {"inner": compiled(made.inner)})
sys.stdin.readline()
print(function(eval(sys.argv[2])))
"""


def test_processes_that_meet_with_different_arguments_keep_each_its_own(tmp_path: Path) -> None:
    """numba's own cache files both under one number, and a third process calls the code of one with the other's."""
    made = module(tmp_path / "kept_source.py")
    command = [sys.executable, "-c", MEETING, str(tmp_path)]
    processes = [
        subprocess.Popen([*command, argument], stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True)
        for argument in ("1", "1.5")
    ]
    said = [process.communicate("go\n", timeout=60)[0].strip() for process in processes]
    here = outer(made)
    assert said == ["6.0", "7.5"] == [str(here(1)), str(here(1.5))]
    assert was_loaded(here)


def test_what_simulation_compiles_is_loaded_the_second_time(folder: Path) -> None:
    from rig.simulation.axis_plant import ForceSensing, ModelledLimb, Motor, PositionLoop, at_rest  # noqa: PLC0415

    limb = ModelledLimb((0.0, 1.0), (0.0, 2.0), 0.0)
    arguments = (at_rest(0.0), Motor(), PositionLoop(), limb, ForceSensing(), 0.5, 8)
    fresh = segments.hold_compiled.__wrapped__  # without what is kept for this process
    first, second = fresh(), fresh()
    assert first(*arguments) == second(*arguments)
    assert was_loaded(second)
    assert len(list(folder.iterdir())) >= 1
