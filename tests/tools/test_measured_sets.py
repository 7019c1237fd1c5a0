"""The command that shows real recordings in the docs runs on them, names their licences, and copies none of them."""

from pathlib import Path

import pytest

from mock_devices.testing.real_data import ROOT
from tests.data import recording
from tools.measured_sets import SETS, MeasuredSet, file_of, main


def test_one_set_becomes_a_page_with_its_answer_and_pictures(tmp_path: Path) -> None:
    recording("franka_joint")
    main(["--only", "franka_joint", "--out", str(tmp_path)])
    (page,) = (tmp_path / "validation").glob("*-measured-sets.md")
    said = page.read_text()
    assert "asked:" in said and "next:" in said and "Coulomb friction of 0.3" in said
    written = {path.name for path in (tmp_path / "figures").iterdir()}
    assert written == {file_of(SETS[-1], name) for name in ("simulation", "residuals")}


@pytest.mark.parametrize("one", SETS, ids=lambda one: one.name)
def test_the_docs_show_every_set_with_its_licence_and_pictures(one: MeasuredSet) -> None:
    page = max((ROOT / "docs" / "validation").glob("*-measured-sets.md"))
    said = page.read_text()
    assert f"## {one.title}" in said and f"licence: {one.licence}." in said
    assert all(f"../figures/{file_of(one, name)}" in said for name in one.pictures)
    files = [ROOT / one.mapping, *(ROOT / "docs" / "figures" / file_of(one, name) for name in one.pictures)]
    assert all(file.is_file() for file in files)
