"""Which protocols `rig serve` shows where none are named: the folder's own, else those that came with the program."""

import os
from pathlib import Path

import pytest

from api.cli import options
from api.http.protocols import ProtocolShelf
from mock_devices.testing.commands import ROOT
from rig.config.wiring import Wiring
from tools.packaged import EXAMPLES


def shown() -> list[str]:
    return [view.name for view in ProtocolShelf(options.protocols_here()).listed(Wiring()) if not view.refusal]


def test_an_empty_folder_has_the_protocols_of_the_checkout_and_one_with_examples_its_own(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    assert shown() == sorted(EXAMPLES)
    (tmp_path / "examples").mkdir()
    assert shown() == []
    (tmp_path / "examples" / "own.toml").write_text('kind = "indentation"\ndepth_mm = 5\n')
    assert shown() == ["own"]


def test_an_installed_program_has_those_that_were_packed_with_it(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    packed = tmp_path / "site-packages" / "api" / "protocols"
    packed.mkdir(parents=True)
    (packed / "quick.toml").write_bytes((ROOT / "examples" / "quick.toml").read_bytes())
    monkeypatch.setattr(options, "__file__", str(tmp_path / "site-packages" / "api" / "cli" / "options.py"))
    assert shown() == ["quick"]


def test_links_that_lead_nowhere_or_to_themselves_and_what_is_no_file_are_listed_with_why_and_hide_no_other(
    tmp_path: Path,
) -> None:
    (tmp_path / "good.toml").write_text('kind = "indentation"\ndepth_mm = 5\n')
    for name, leads_to in (("gone", "nowhere.toml"), ("round", "round.toml")):
        (tmp_path / f"{name}.toml").symlink_to(leads_to)
    (tmp_path / "endless.toml").symlink_to("/dev/zero")
    os.mkfifo(tmp_path / "pipe.toml")
    found = {view.name: view.refusal for view in ProtocolShelf(tmp_path).listed(Wiring())}
    assert found.keys() == {"good", "gone", "round", "endless", "pipe"} and found["good"] == ""
    assert "cannot be read: No such file or directory" in found["gone"]
    assert "cannot be read: Too many levels of symbolic links" in found["round"]
    assert all(found[name].endswith(f"{name}.toml: is no file") for name in ("endless", "pipe"))
