"""Each group of entry points, by the name that the documentation says, brings what another distribution declares."""

import json
import os
import re
import subprocess
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[2]
ACME = """
from dataclasses import dataclass, replace
from typing import ClassVar, Literal
from pydantic import Field
from rig.config.products.bota_sensone import BotaWiring
from rig.config.products.evdev_switch import EvdevSwitch
from rig.config.products.maxon_epos4 import Epos4Wiring
from rig.config.products.ndi_polaris import PolarisWiring

class Force(BotaWiring):
    product: Literal["acme-force"] = Field(default="acme-force", description="what stands on the bench")

class Axis(Epos4Wiring):
    product: Literal["acme-axis"] = Field(default="acme-axis", description="what stands on the bench")

class Tracker(PolarisWiring):
    product: Literal["acme-tracker"] = Field(default="acme-tracker", description="what stands on the bench")

class Pedal(EvdevSwitch):
    product: Literal["acme-input"] = Field(default="acme-input", description="what it is")
"""
OTHERS = {
    "law": '''
from dataclasses import dataclass
from typing import ClassVar
from rig.tissue.laws_elastic import Quadratic

@dataclass(frozen=True, kw_only=True)
class Declared(Quadratic):
    """Another name for it."""
    name: ClassVar[str] = "acme-law"
''',
    "cause": """
from dataclasses import replace
from rig.diagnosis.effects.cogging import COGGING

Declared = replace(COGGING, amplitudes=(replace(COGGING.amplitudes[0], name="acme-cause"),))
""",
    "axis_cause": """
from dataclasses import replace
from rig.diagnosis.effects.axis import COULOMB

Declared = replace(COULOMB, name="acme-axis_cause")
""",
}
POINTS = {
    "force": "acme_products:Force",
    "axis": "acme_products:Axis",
    "tracker": "acme_products:Tracker",
    "input": "acme_products:Pedal",
} | {group: f"acme_{group}:Declared" for group in OTHERS}
LOOK = """
import json
from rig import plugins
from rig.config.products.inputs import EVERY_ROLE
from rig.config.table import parse
from rig.config.wiring import Wiring
from rig.diagnosis.effects.axis import AXIS_CAUSES
from rig.diagnosis.effects.registry import CAUSES
from rig.tissue.registry import LAWS
wiring = parse(Wiring, {"input": {"pedal": {"product": "acme-input", "key": "b"}}}, "rig.toml")
print(json.dumps({
    "taken": {name: list(one) for name, one in
              {**EVERY_ROLE, "law": LAWS, "cause": CAUSES, "axis_cause": AXIS_CAUSES}.items()},
    "wired": type(wiring.input["pedal"]).__module__,
    "groups": list(plugins.met()),
    "errors": [one.sentence for one in plugins.failures()],
}))
"""


def install(folder: Path) -> None:
    """A distribution as an installer leaves it."""
    about = folder / "acme-1.0.dist-info"
    about.mkdir()
    (about / "METADATA").write_text("Metadata-Version: 2.1\nName: acme\nVersion: 1.0\n")
    lines = [f"[tissue_rig.{group}]\nx = {point}" for group, point in POINTS.items()]
    (about / "entry_points.txt").write_text("\n".join([*lines, ""]))
    (folder / "acme_products.py").write_text(ACME)
    for group, source in OTHERS.items():
        (folder / f"acme_{group}.py").write_text(source)


@pytest.fixture(scope="module")
def found(tmp_path_factory: pytest.TempPathFactory) -> dict[str, object]:
    """What a program of today sees beside such a distribution."""
    folder = tmp_path_factory.mktemp("site")
    install(folder)
    environment = os.environ | {"PYTHONPATH": os.pathsep.join(map(str, (folder, ROOT)))}
    said = subprocess.run(
        [sys.executable, "-c", LOOK], env=environment, capture_output=True, text=True, timeout=100, check=False
    )
    assert said.returncode == 0, said.stderr
    answer: dict[str, object] = json.loads(said.stdout)
    return answer


@pytest.mark.parametrize("group", POINTS)
def test_what_another_distribution_declares_in_a_group_is_taken(group: str, found: dict[str, object]) -> None:
    taken = found["taken"]
    assert isinstance(taken, dict)
    assert f"acme-{group}" in taken[group]


def test_nothing_of_it_failed_and_a_table_may_name_it(found: dict[str, object]) -> None:
    assert (found["errors"], found["wired"]) == ([], "acme_products")


def test_the_groups_are_those_of_the_documentation(found: dict[str, object]) -> None:
    named = re.findall(r"`tissue_rig\.(\w+)`", (ROOT / "docs" / "explanation" / "architecture.md").read_text())
    groups = found["groups"]
    assert isinstance(groups, list)
    assert set(named) == set(POINTS) == {group.removeprefix("tissue_rig.") for group in groups}
