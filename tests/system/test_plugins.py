"""Plug-ins as a laboratory has them: built as wheels, installed beside, and tested by their own tests."""

import os
import shutil
import subprocess
import sys
import zipfile
from collections.abc import Mapping
from pathlib import Path

import pytest
from copier import run_copy

from mock_devices.testing.commands import ROOT
from rig.recording.reader import read_recording

pytestmark = [pytest.mark.xdist_group("commands"), pytest.mark.timeout(300)]


def run(
    *command: str | Path, folder: Path, environment: Mapping[str, str] = os.environ
) -> "subprocess.CompletedProcess[str]":
    return subprocess.run(
        list(map(str, command)), cwd=folder, env=environment, capture_output=True, text=True, timeout=280, check=False
    )


def installed(project: Path, target: Path) -> dict[str, str]:
    """The wheel of ``project`` unpacked with its metadata, as an installer does; the environment that finds it."""
    built = run(sys.executable, "-m", "hatchling", "build", "-t", "wheel", "-d", target / "wheels", folder=project)
    assert built.returncode == 0, built.stderr
    (wheel,) = (target / "wheels").iterdir()
    zipfile.ZipFile(wheel).extractall(target / "site")
    paths = os.pathsep.join(map(str, (target / "site", ROOT)))
    return os.environ | {"PYTHONPATH": paths, "XDG_STATE_HOME": str(target / "state"), "COLUMNS": "200"}


def passes_its_own_tests(project: Path, environment: Mapping[str, str]) -> None:
    """Its own tests pass, each of them."""
    found = run(sys.executable, "-m", "pytest", "-q", "-p", "no:cacheprovider", folder=project, environment=environment)
    assert found.returncode == 0, found.stdout[-4000:] + found.stderr[-2000:]
    assert " passed" in found.stdout and "skipped" not in found.stdout


@pytest.mark.extra
@pytest.mark.every_commit
def test_the_net_ft_is_a_distribution_of_its_own(tmp_path: Path) -> None:
    project = tmp_path / "plugin"
    shutil.copytree(ROOT / "examples" / "plugin-netft", project)
    sources = [path.name for path in (project / "src" / "rig_netft").glob("*.py")]
    assert sorted(sources) == ["__init__.py", "mock.py", "netft.py"]
    environment = installed(project, tmp_path / "target")
    listed = run(sys.executable, "-m", "pytest", "--version", folder=project, environment=environment)
    assert listed.returncode == 0
    said = run(Path(sys.executable).with_name("rig"), "devices", "ati-netft", folder=tmp_path, environment=environment)
    assert "tissue-rig-netft 1.0.0" in said.stdout and "force.http_port" in said.stdout, said.stderr
    passes_its_own_tests(project, environment)


@pytest.mark.extra
@pytest.mark.every_commit
def test_the_template_makes_a_plug_in_that_works(tmp_path: Path) -> None:
    answers = {"distribution": "rig-lab", "package": "rig_lab", "product": "lab-seven", "range_N": 25.0, "rate_Hz": 500}
    project = tmp_path / "made"
    run_copy(str(ROOT / "examples" / "plugin-template"), project, data=answers, defaults=True, quiet=True)
    assert not [path for path in project.rglob("*") if "{{" in str(path) or path.suffix == ".jinja"]
    assert all("{{" not in path.read_text() for path in project.rglob("*") if path.is_file())
    passes_its_own_tests(project, installed(project, tmp_path / "target"))


def without_what_developers_install(folder: Path) -> dict[str, str]:
    """An environment in which no HTTP client can be imported, as `pip install tissue-rig pytest` brings none."""
    (folder / "hidden").mkdir()
    (folder / "hidden" / "sitecustomize.py").write_text("import sys; sys.modules.update(httpx=None, httpx2=None)\n")
    paths = os.pathsep.join(map(str, (folder / "hidden", ROOT)))
    return os.environ | {"PYTHONPATH": paths, "XDG_STATE_HOME": str(folder / "state")}


@pytest.mark.extra
def test_a_laboratorys_own_checks_run_as_the_workflow_says(tmp_path: Path) -> None:
    shutil.copytree(ROOT / "examples" / "ci", tmp_path / "ci")
    workflow = (tmp_path / "ci" / "laboratory.yml").read_text()
    steps = [line.partition("run: ")[2] for line in workflow.splitlines() if "run: " in line]
    assert steps == ["pip install tissue-rig pytest", "rig devices", "pytest test_laboratory.py"]
    environment = without_what_developers_install(tmp_path)
    hidden = run(sys.executable, "-c", "import httpx2", folder=tmp_path, environment=environment)
    assert "ModuleNotFoundError" in hidden.stderr
    for step in steps[1:]:
        program, *arguments = step.split()
        done = run(Path(sys.executable).with_name(program), *arguments, folder=tmp_path / "ci", environment=environment)
        assert done.returncode == 0, done.stdout[-4000:] + done.stderr[-2000:]


def beside(folder: Path, points: str, module: str) -> dict[str, str]:
    """The environment that finds the distribution `acme`, made of one ``module`` that declares ``points``."""
    about = folder / "site" / "acme-1.0.dist-info"
    about.mkdir(parents=True)
    (about / "METADATA").write_text("Metadata-Version: 2.1\nName: acme\nVersion: 1.0\n")
    (about / "entry_points.txt").write_text(points)
    (folder / "site" / "acme_bench.py").write_text(module)
    paths = os.pathsep.join(map(str, (folder / "site", ROOT)))
    return os.environ | {"PYTHONPATH": paths, "XDG_STATE_HOME": str(folder / "state"), "COLUMNS": "200"}


ACME = """
from typing import ClassVar, Literal
from pydantic import Field
from rig.config.products.maxon_epos4 import Epos4Wiring
from rig.config.products.ndi_polaris import PolarisWiring

class Axis(Epos4Wiring):
    "Another maker's axis, spoken to like ours, with a key of its own."
    product: Literal["acme-axis"] = Field(default="acme-axis", description="what stands on the bench")
    brake_test: bool = Field(default=False, description="before each session")

class Tracker(PolarisWiring):
    "Another maker's tracker."
    product: Literal["acme-eye"] = Field(default="acme-eye", description="what stands on the bench")
    rate_Hz: float = Field(default=60.0, gt=0, le=500, description="frames a second")
"""


FAILING = """
from typing import ClassVar, Literal
from pydantic import Field
from mock_devices.quantities import read
from rig.config.products.bota_sensone import BotaWiring
from rig.config.products.roles import MockPort

class Failing(BotaWiring):
    "Another maker's sensor, whose mock fails once the tip presses."
    mock: ClassVar[MockPort | None] = MockPort("acme_bench:make", "force")
    product: Literal["acme-cell"] = Field(default="acme-cell", description="what stands on the bench")

def make(factory):
    (device,) = factory.bota()
    tick = device.mock.tick

    def failing(now_ns):
        if read(factory.bench, "tip.force_N") > 2.0:
            raise KeyError("counts")
        tick(now_ns)

    device.mock.tick = failing
    return [device]
"""


@pytest.mark.extra
def test_where_a_plug_ins_mock_fails_the_tip_comes_out_and_both_sentences_say_why(tmp_path: Path) -> None:
    """Only the axis, which goes on, can take the tip out of the tissue, at 20 mm, to the clearance."""
    environment = beside(tmp_path, "[tissue_rig.force]\nf = acme_bench:Failing\n", FAILING)
    (tmp_path / "slow.toml").write_text(
        'kind = "indentation"\nspeeds_mm_s = [5]\ntrials = 1\ndepth_mm = 8\nair_dwell_s = 0.2\n'
        "approach_speed_mm_s = 20\nhold_s = 20\nretract_speed_mm_s = 20\nclearance_mm = 4\nforce_limit_N = 12\n"
    )
    said = run(
        Path(sys.executable).with_name("rig"), "capture", "slow.toml", "--out", "session", "--set",
        "force.product=acme-cell", folder=tmp_path, environment=environment,
    )  # fmt: skip
    assert said.returncode == 3, said.stderr
    named = [line for line in said.stderr.splitlines() if line.startswith("bench: tissue_rig.force")]
    assert named == [
        "bench: tissue_rig.force 'f' of acme 1.0: its mock at force is silent from now on, as a lost device, for it"
        " raised KeyError: 'counts'; see its maker"
    ]
    last = said.stderr.splitlines()[-1]
    assert last.startswith("rig: stopped: force: ") and "Traceback" not in said.stderr
    recording = read_recording(tmp_path / "session" / "trial_001.mcap")
    assert recording.damage == ()
    assert recording.tables["axis"]["position_mm"].max() > 20.0 > recording.tables["axis"]["position_mm"][-1]


@pytest.mark.extra
def test_axis_and_tracker_of_plug_ins_stand_on_the_mock_bench(tmp_path: Path) -> None:
    """Doctor sees both through the guard, beside our own sensor."""
    points = "[tissue_rig.axis]\na = acme_bench:Axis\n[tissue_rig.tracker]\nt = acme_bench:Tracker\n"
    environment = beside(tmp_path, points, ACME)
    settings = [part for key in ("axis.product=acme-axis", "axis.brake_test=true", "tracker.product=acme-eye")
                for part in ("--set", key)]  # fmt: skip
    said = run(Path(sys.executable).with_name("rig"), "doctor", *settings, folder=tmp_path, environment=environment)
    assert said.returncode == 0, said.stderr
    assert "EPOS4" in said.stdout.upper() and "POLARIS" in said.stdout.upper()
    refused = run(
        Path(sys.executable).with_name("rig"), "doctor", "--set", "tracker.product=acme-eye", "--set",
        "tracker.rate_Hz=600", folder=tmp_path, environment=environment,
    )  # fmt: skip
    assert refused.returncode == 2 and "tracker.rate_Hz: Input should be less than or equal to 500" in refused.stderr
