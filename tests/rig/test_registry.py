"""What other distributions declare is found by entry point, and what cannot be loaded is said with whose it is."""

from pathlib import Path

import pytest

from rig import registry
from rig.errors import UsageError
from rig.registry import Registry


@pytest.fixture
def installed(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """Where a distribution "acme" is installed, with one good declaration and one in a module it lacks."""
    about = tmp_path / "acme-1.0.dist-info"
    about.mkdir()
    (about / "METADATA").write_text("Metadata-Version: 2.1\nName: acme\nVersion: 1.0\n")
    (about / "entry_points.txt").write_text("[rig.good]\nx = acme_plug:WORD\n[rig.broken]\ny = acme_lacks:WORD\n")
    (tmp_path / "acme_plug.py").write_text("WORD = 'plugged'\n")
    monkeypatch.syspath_prepend(str(tmp_path))
    monkeypatch.setattr("rig.registry._advertised", registry._advertised.__wrapped__)
    return tmp_path


@pytest.mark.usefixtures("installed")
def test_a_declaration_of_another_distribution_is_registered_after_our_own() -> None:
    assert list(Registry("word", str, ("own",), "rig.good")) == ["own", "plugged"]
    assert list(Registry("word", str, ("own",))) == ["own"]


@pytest.mark.usefixtures("installed")
def test_a_declaration_that_cannot_be_loaded_names_its_distribution() -> None:
    with pytest.raises(UsageError, match=r"rig.broken 'y' of acme cannot be loaded: .*acme_lacks.*; mend or uninstall"):
        Registry("word", str, (), "rig.broken")


@pytest.mark.usefixtures("installed")
def test_a_name_that_is_taken_is_refused() -> None:
    with pytest.raises(ValueError, match="there is a word 'plugged' already"):
        Registry("word", str, ("plugged",), "rig.good")
