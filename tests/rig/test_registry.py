"""What other distributions declare is found by entry point; what cannot be used is named and harms nothing else."""

import importlib
import sys
from collections.abc import Callable
from pathlib import Path

import pytest

from rig import plugins
from rig.errors import UsageError
from rig.plugins import instance_of
from rig.registry import Registry

Install = Callable[..., None]


@pytest.fixture
def install(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Install:
    """Installs a distribution with a module and entry points of the group `rig.word`."""
    monkeypatch.syspath_prepend(str(tmp_path))
    monkeypatch.setattr(sys, "dont_write_bytecode", True)
    monkeypatch.setattr("rig.plugins._advertised", plugins._advertised.__wrapped__)
    monkeypatch.setattr("rig.plugins._met", {})

    def installed(name: str, source: str, **points: str) -> None:
        about = tmp_path / f"{name}-1.0.dist-info"
        about.mkdir()
        (about / "METADATA").write_text(f"Metadata-Version: 2.1\nName: {name}\nVersion: 1.0\n")
        lines = [f"{key} = {value}" for key, value in points.items()]
        (about / "entry_points.txt").write_text("\n".join(["[rig.word]", *lines, ""]))
        (tmp_path / f"{name}_plug.py").write_text(source)
        sys.modules.pop(f"{name}_plug", None)
        importlib.invalidate_caches()

    return installed


def words(*own: str) -> Registry[str]:
    return Registry("word", str, own, "rig.word", instance_of(str))


def errors() -> dict[str, str]:
    return {plugin.distribution: plugin.error for plugin in plugins.failures()}


def test_a_declaration_of_another_distribution_is_registered_after_our_own(install: Install) -> None:
    install("acme", "WORD = 'plugged'\n", x="acme_plug:WORD")
    assert list(words("own")) == ["own", "plugged"]
    assert list(Registry("word", str, ("own",))) == ["own"]
    (plugin,) = plugins.met()["rig.word"]
    assert (plugin.name, plugin.distribution, plugin.version, plugin.declares) == ("x", "acme", "1.0", "plugged")
    assert errors() == {}


@pytest.mark.parametrize(
    ("source", "error"),
    [
        ("import acme_lacks\n", "ModuleNotFoundError: No module named 'acme_lacks'"),
        ("raise RuntimeError('no licence dongle')\n", "RuntimeError: no licence dongle"),
        ("import sys\nsys.exit('not on this system')\n", "SystemExit: not on this system"),
        ("OTHER = 1\n", "AttributeError: module 'bad_plug' has no attribute 'WORD'"),
        ("WORD = 7\n", "is 7, where a str is expected"),
        ("WORD = 'own'\n", "there is a word 'own' already; give it another name"),
    ],
)
def test_one_that_cannot_be_used_is_named_and_harms_no_other(install: Install, source: str, error: str) -> None:
    install("bad", source, x="bad_plug:WORD")
    install("good", "WORD = 'plugged'\n", x="good_plug:WORD")
    found = words("own")
    assert list(found) == ["own", "plugged"]
    assert errors() == {"bad": error}
    with pytest.raises(
        UsageError, match=r"unknown word 'wrod'.*; plug-ins that cannot be used: rig.word 'x' of bad 1.0"
    ):
        found.named("wrod")


def test_of_two_plug_ins_with_one_name_neither_is_used(install: Install) -> None:
    for name in ("one", "two"):
        install(name, "WORD = 'same'\n", x=f"{name}_plug:WORD")
    assert list(words("own")) == ["own"]
    assert errors() == dict.fromkeys(("one", "two"), "2 plug-ins declare 'same'; uninstall others")


def test_a_name_is_registered_once() -> None:
    with pytest.raises(ValueError, match="there is a word 'own' already"):
        words("own", "own")


@pytest.mark.parametrize(
    "source",
    ["import time\ntime.sleep(60)\n", "import time\ntry:\n    time.sleep(60)\nexcept Exception:\n    time.sleep(60)\n"],
)
def test_one_whose_import_does_not_end_is_given_up_and_harms_no_other(
    install: Install, monkeypatch: pytest.MonkeyPatch, source: str
) -> None:
    """Also one that swallows what is raised in it."""
    monkeypatch.setattr(plugins, "IMPORT_S", 0.1)
    install("bad", source, x="bad_plug:WORD")
    install("good", "WORD = 'plugged'\n", x="good_plug:WORD")
    assert list(words("own")) == ["own", "plugged"]
    assert errors() == {"bad": "TimeoutError: not done within 0.1 s"}
