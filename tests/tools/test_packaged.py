"""A wheel that lacks a file of the packages is refused by name."""

import zipfile
from pathlib import Path

import pytest

from tools.packaged import BESIDE, PACKAGES, ROOT, missing


def lay_out(root: Path) -> None:
    for package in PACKAGES:
        (root / package).mkdir()
        (root / package / "__init__.py").write_text("")
    (root / "api" / "page" / "sources").mkdir(parents=True)
    (root / "api" / "page" / "sources" / "main.tsx").write_text("")
    (root / "rig" / "template.html").write_text("<html>")
    (root / "rig" / "__pycache__").mkdir()
    (root / "rig" / "__pycache__" / "a.pyc").write_text("")


def pack(root: Path, without: str = "") -> Path:
    wheel = root / "a.whl"
    with zipfile.ZipFile(wheel, "w") as archive:
        for package in PACKAGES:
            archive.writestr(f"{package}/__init__.py", "")
        for name in ("rig/template.html", *BESIDE):
            if name != without:
                archive.writestr(name, "<html>")
    return wheel


@pytest.mark.parametrize("name", ["rig/template.html", *BESIDE])
def test_a_file_that_was_not_packed_is_named_and_so_is_a_page_that_was_not_built(name: str, tmp_path: Path) -> None:
    lay_out(tmp_path)
    assert missing(pack(tmp_path, without=name), tmp_path) == [name]


def test_a_whole_wheel_lacks_nothing_and_caches_and_sources_of_the_page_are_not_asked_for(tmp_path: Path) -> None:
    lay_out(tmp_path)
    assert not missing(pack(tmp_path), tmp_path)


def test_the_packages_are_those_that_are_built() -> None:
    listed = (ROOT / "pyproject.toml").read_text().partition("[tool.hatch.build.targets.wheel]\npackages = [")[2]
    assert tuple(name.strip(' "') for name in listed.partition("]")[0].split(",")) == PACKAGES
