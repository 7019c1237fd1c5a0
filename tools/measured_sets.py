"""Makes the page of recordings that others measured, with its pictures: ``python -m tools.measured_sets`` (a minute).

Reads the folder of real recordings (TISSUE_RIG_DATA, or shared/data beside the project). What is written holds numbers
and pictures, and nothing of the recordings; ``--only NAME`` makes one set, ``--out FOLDER`` writes elsewhere than docs.
"""

import argparse
import subprocess
import sys
import tempfile
from collections.abc import Sequence
from datetime import UTC, date, datetime
from pathlib import Path
from typing import NamedTuple

from PIL import Image

from api.operations.diagnose import diagnose
from controller.operation import Operation
from mock_devices.testing.real_data import ROOT, folder
from rig.results.diagnosis import DiagnosisResult
from rig.results.diagnosis_lines import five_lines
from rig.trials.opening import Opening

WIDTH = 900  # pixels: a picture of 9 inches is read at 100 to the inch
COLOURS = 256  # a third of the file, and no line looks different


class MeasuredSet(NamedTuple):
    """Recordings of one maker: where they are, which of them, whose they are under what licence, what is shown."""

    name: str
    only: str
    title: str
    source: str
    licence: str
    pictures: tuple[str, str]
    reference: str = ""

    @property
    def mapping(self) -> str:
        """How its files are read."""
        return f"examples/mappings/{self.name}.toml"

    @property
    def command(self) -> str:
        """What a person types for the same answer."""
        only = f" --only '{self.only}'" if self.only else ""
        reference = f" --reference {self.reference}" if self.reference else ""
        return f"rig diagnose {self.name} --mapping {self.mapping}{only}{reference} --out pictures"


SETS = (
    MeasuredSet(
        "perineal_indentation", "230411_C_Ind*_RDG*",
        "Meat under a testing machine: ramp, hold, recover",
        "SarahIaquinta/perineal_indentation on GitHub", "GPL-3.0", ("share", "simulation"),
    ),
    MeasuredSet(
        "asmi", "run_002*",
        "Hydrogel in a well plate under a gantry with a load cell",
        "BU-KABlab/ASMI_new on GitHub", "none stated, so numbers and pictures only", ("residuals", "simulation"),
    ),
    MeasuredSet(
        "emps", "",
        "A ball-screw servo axis under a known controller; the recording with pulses is left out",
        'Janot, Gautier, Brunot 2019, "Data Set and Reference Models of EMPS"',
        "published for comparison, none stated", ("simulation", "residuals"), "examples/axis_models/emps.toml",
    ),
    MeasuredSet(
        "franka_joint", "",
        "Joint 2 of an arm, slow, its torque with the model's part taken off",
        "published with six models' predictions", "none stated, so numbers and pictures only",
        ("simulation", "residuals"),
    ),
)  # fmt: skip


def main(arguments: Sequence[str]) -> None:
    """Diagnoses each set; writes its pictures and the page."""
    asked = argparse.ArgumentParser(prog="python -m tools.measured_sets")
    asked.add_argument("--only", choices=[one.name for one in SETS])
    asked.add_argument("--out", type=Path, default=ROOT / "docs")
    given = asked.parse_args(arguments)
    chosen = [one for one in SETS if given.only in (None, one.name)]
    today = datetime.now(UTC).date()
    parts = [made(one, given.out / "figures") for one in chosen]
    page = given.out / "validation" / f"{today}-measured-sets.md"
    page.parent.mkdir(parents=True, exist_ok=True)
    page.write_text(head(today, commit()) + "".join(parts), encoding="utf-8")
    sys.stderr.write(f"{page} and its pictures are written\n")


def commit() -> str:
    """What the program was when it answered."""
    asked = ["git", "rev-parse", "--short", "HEAD"]
    told = subprocess.run(asked, cwd=ROOT, capture_output=True, text=True, check=False)
    return told.stdout.strip() or "unknown"


def head(today: date, revision: str) -> str:
    """The page above its sets."""
    return f"""# Recordings that others measured

| | |
|---|---|
| date | {today} |
| commit | {revision} |
| command | `python -m tools.measured_sets` |

Each set is read as its maker left it, by its mapping in `examples/mappings`, and diagnosed; the lines are the five that
`rig diagnose` begins with. The recordings are not part of this project; the command reads them from the folder in
`TISSUE_RIG_DATA`. Nobody hid anything in them, so there is no truth to compare with but what their makers know.
"""


def made(one: MeasuredSet, pictures: Path) -> str:
    """The part of the page on one set, whose pictures are left in the folder ``pictures``."""
    pictures.mkdir(parents=True, exist_ok=True)
    opening, reference = Opening(ROOT / one.mapping, one.only), ROOT / one.reference if one.reference else None
    with tempfile.TemporaryDirectory() as scratch:
        out = Path(scratch)
        result = diagnose(Operation("diagnose"), folder() / one.name, out=out, opening=opening, reference=reference)
        for name in one.pictures:
            shrink(out / f"{name}.png", pictures / file_of(one, name))
    return part(one, result)


def shrink(source: Path, target: Path) -> None:
    """Copies a picture as wide as a page shows it, in as many colours as it needs."""
    with Image.open(source) as whole:
        height = round(whole.height * WIDTH / whole.width)
        whole.convert("RGB").resize((WIDTH, height), Image.Resampling.LANCZOS).quantize(COLOURS).save(
            target, optimize=True
        )


def file_of(one: MeasuredSet, picture: str) -> str:
    """Name of a picture's file."""
    return f"measured-{one.name.replace('_', '-')}-{picture}.png"


def part(one: MeasuredSet, result: DiagnosisResult) -> str:
    """Heading, origin, answer and pictures of one set."""
    lines = "\n".join(five_lines(result))
    shown = "\n".join(f"![{one.title}: {name}](../figures/{file_of(one, name)})" for name in one.pictures)
    return f"""
## {one.title}

Source: {one.source}; licence: {one.licence}. `{one.command}`:

```text
{lines}
```

{shown}
"""


if __name__ == "__main__":
    main(sys.argv[1:])
