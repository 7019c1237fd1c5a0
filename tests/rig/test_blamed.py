"""What a plug-in's law or cause raises while it is used ends in a sentence that names the plug-in, in any process."""

import os
import subprocess
import sys
from concurrent.futures import ProcessPoolExecutor
from multiprocessing import get_context
from pathlib import Path

import pytest

from rig import plugins
from rig.plugins import Plugin, blamed
from tests.rig.intake.instruments import PRESS

ROOT = Path(__file__).parents[2]
ACME = Plugin("tissue_rig.law", "x", "acme", "1.0", "acme-law", module="acme_law")
LAW = '''
from dataclasses import dataclass
from typing import ClassVar
from rig.tissue.laws_elastic import Quadratic

@dataclass(frozen=True, kw_only=True)
class Declared(Quadratic):
    """Another name for it."""
    name: ClassVar[str] = "acme-law"

    def elastic(self, depth_mm):
        raise ZeroDivisionError("nobody tried this")

def fails():
    raise ZeroDivisionError("nobody tried this")
'''
BAD = """
from typing import ClassVar
from rig.tissue.laws import Law

class Bare(Law):
    name: ClassVar[str] = "bare"

class Named:
    name = "acme-cause"

NAMED = Named()
"""
SENTENCE = "tissue_rig.law 'x' of acme 1.0: ZeroDivisionError: nobody tried this; see its maker, or uninstall it"


@pytest.fixture
def site(tmp_path: Path) -> Path:
    """A folder with the distribution as an installer leaves it."""
    about = tmp_path / "acme-1.0.dist-info"
    about.mkdir()
    (about / "METADATA").write_text("Metadata-Version: 2.1\nName: acme\nVersion: 1.0\n")
    (about / "entry_points.txt").write_text("[tissue_rig.law]\nx = acme_law:Declared\n")
    (tmp_path / "acme_law.py").write_text(LAW)
    return tmp_path


@pytest.fixture
def met(site: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.syspath_prepend(str(site))
    monkeypatch.setattr(plugins, "_met", {"tissue_rig.law": (ACME,)})


def _python(site: Path, *arguments: str) -> "subprocess.CompletedProcess[str]":
    environment = os.environ | {"PYTHONPATH": os.pathsep.join(map(str, (site, ROOT)))}
    return subprocess.run(
        [sys.executable, *arguments], env=environment, capture_output=True, text=True, timeout=120, check=False
    )


def error_of(work: object) -> Exception:
    try:
        work()  # type: ignore[operator]
    except Exception as error:
        return error
    raise AssertionError("nothing was raised")


@pytest.mark.usefixtures("met")
def test_what_arises_in_a_plug_in_is_its_own() -> None:
    import acme_law  # type: ignore[import-not-found] # noqa: PLC0415

    assert str(blamed(error_of(acme_law.fails))) == SENTENCE
    with ProcessPoolExecutor(1, mp_context=get_context("fork")) as pool:
        assert str(blamed(error_of(pool.submit(acme_law.fails).result))) == SENTENCE
    assert blamed(error_of(lambda: 1 / 0)) is None


def test_where_no_plug_in_is_nobody_is_blamed(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(plugins, "_met", {"tissue_rig.law": ()})
    assert blamed(error_of(lambda: 1 / 0)) is None


def test_a_command_that_uses_it_ends_in_the_sentence(site: Path, tmp_path: Path) -> None:
    file = tmp_path / "press.csv"
    file.write_text("Time (s),Position (mm),Force (N)\n" + PRESS)
    said = _python(site, "-m", "api.cli", "fit", str(file), "--yes", "--laws", "acme-law", "--out", str(tmp_path / "o"))
    assert (said.returncode, "Traceback" in said.stderr) == (1, False), said.stderr
    assert SENTENCE in " ".join(said.stderr.split())


REFUSED = """
from rig import plugins
from rig.diagnosis.effects.axis import AXIS_CAUSES
from rig.tissue.registry import LAWS
print(*(one.sentence for one in plugins.failures()), sep=chr(10))
assert {"acme-cause", "bare"}.isdisjoint([*AXIS_CAUSES, *LAWS])
"""


def test_what_lacks_what_laws_and_causes_have_is_refused_before_it_is_used(site: Path) -> None:
    (site / "acme_bad.py").write_text(BAD)
    points = "[tissue_rig.law]\nx = acme_bad:Bare\n[tissue_rig.axis_cause]\ny = acme_bad:NAMED\n"
    (site / "acme-1.0.dist-info" / "entry_points.txt").write_text(points)
    said = _python(site, "-c", REFUSED)
    assert said.returncode == 0, said.stderr
    assert "Bare has no elastic, elastic_inverse, near, slope, formula, bounds" in said.stdout
    assert "where a AxisEffect is expected" in said.stdout
