"""The reference names every key with its bounds and every command; a page cannot name a part that does not exist."""

import re
from collections.abc import Iterator
from pathlib import Path
from typing import Annotated, Literal, get_args

import pytest
from pydantic import BaseModel, Field

from api.cli.app import COMMANDS
from rig.config.calibration import Calibration
from rig.config.products.registry import ROLES
from rig.config.protocol import Indentation
from rig.config.quality import Bounds, QualityLimits
from rig.config.stop import Stop
from rig.config.subject import Subject
from rig.config.table import Table
from rig.config.wiring import Limits, Loop, MockBenchSettings, Wiring
from rig.diagnosis.effects.registry import CAUSES
from rig.tissue.registry import LAWS
from tools.keys import tables
from tools.reference import GENERATORS, MARK, fill

PAGES = Path(__file__).parents[2] / "docs"
PRODUCTS = [product for products in ROLES.values() for product in products.values()]


PRODUCTS = [product for products in ROLES.values() for product in products.values()]


class Spring(Table):
    """A spring with ``stiffness``."""

    stiffness_N_mm: float = Field(gt=0, lt=5, description="of the spring")
    kind: Literal["linear", "index"] = "index"


class Bench(Table):
    """Two springs and a list."""

    left: Spring = Spring(stiffness_N_mm=1.0)
    right: Spring | None = None
    names: tuple[str, ...] = Field(default=(), max_length=3)
    count: int


class Left(Table):
    """A sensor that is read from the left."""

    product: Literal["left"] = "left"
    port: str


class Right(Table):
    """A sensor that is read from the right."""

    product: Literal["right"] = "right"
    address: str


class Choice(Table):
    """One sensor or the other."""

    sensor: Annotated[Left | Right, Field(discriminator="product")]


def keys(model: type[BaseModel]) -> Iterator[tuple[type[BaseModel], str]]:
    for name, field in model.model_fields.items():
        yield model, name
        for part in (field.annotation, *get_args(field.annotation)):
            if isinstance(part, type) and issubclass(part, BaseModel):
                yield from keys(part)


def test_a_row_has_value_bounds_default_and_meaning() -> None:
    text = tables(Bench, {"Spring.stiffness_N_mm": "never above 4 N/mm: it breaks"})
    assert "| `count` | whole number | required | |" in text
    assert "| `names` | list of: text, at most 3 | `[]` | |" in text
    assert "| `stiffness_N_mm` | number, > 0, < 5 | required | of the spring; never above 4 N/mm: it breaks |" in text
    assert '| `kind` | `"linear"`, `"index"` | `"index"` | |' in text


def test_a_table_that_two_keys_lead_to_stands_once() -> None:
    text = tables(Bench, {})
    assert text.count("## `Spring`") == 1
    assert "A spring with `stiffness`." in text


def test_tables_that_stand_in_one_place_are_told_apart() -> None:
    text = tables(Choice, {"sensor.port": "never on Sundays"})
    assert '## `sensor`: product = `"left"`' in text
    assert '## `sensor`: product = `"right"`' in text
    assert "| `port` | text | required | never on Sundays |" in text


@pytest.mark.parametrize(("mark", "model"), [("wiring", Wiring), ("protocol", Indentation)])
def test_every_key_of_the_models_stands_in_the_reference(mark: str, model: type[BaseModel]) -> None:
    text = fill(f"<!-- generated: {mark} -->")
    named = list(keys(model))
    assert len(named) > 20
    forms = ("| `{0}` |", "`{0}`\n", "## `{0}`: ", "`{0}.NAME`: ")
    missing = [name for owner, name in named if not any(form.format(name) in text for form in forms)]
    assert not missing


@pytest.mark.parametrize(
    "model",
    [*PRODUCTS, Indentation, QualityLimits, Bounds, Loop, Limits, Subject, MockBenchSettings, Stop, Calibration],
)
def test_every_key_that_a_person_writes_has_a_meaning(model: type[BaseModel]) -> None:
    silent = [name for name, field in model.model_fields.items() if not field.description and name != "quality"]
    assert not silent


def test_a_maximum_stands_beside_its_key() -> None:
    assert "never above 50 N: ISO/TS 15066" in fill("<!-- generated: wiring -->")


def test_each_product_has_a_table_of_its_own_with_its_own_maxima() -> None:
    said = fill("<!-- generated: wiring -->")
    assert said.count("## `force`: product = ") == len(ROLES["force"])
    assert "never above 15 A: EPOS4 50/5" in said


def test_every_command_stands_in_the_reference_with_its_help() -> None:
    text = fill("before\n\n<!-- generated: commands -->\n\nafter")
    for name in COMMANDS:
        assert f"## rig {name}\n" in text
        assert f"Usage: rig {name} " in text


def test_every_route_stands_in_the_reference_with_body_and_answers() -> None:
    text = fill("<!-- generated: http -->")
    start = text.partition("## POST /api/v1/jobs\n")[2].partition("\n## ")[0]
    assert "- `X-Control-Lease` (header): text" in start
    assert "- body: table `CaptureJob` or table `TrackJob`" in start
    assert "- 409: not in the present state" in start
    for name in ("CaptureParams", "LeaseView", "Problem"):
        assert f"## `{name}`\n" in text
    assert "## POST /api/v1/estop\n" in text


def test_a_law_stands_in_the_reference_with_units_bounds_and_what_is_given() -> None:
    text = fill("<!-- generated: laws -->")
    index = text.partition("## `index`\n")[2].partition("\n## ")[0]
    assert "`F = a x exp(b x) + B v`" in index
    assert "| `b_per_mm` | 1/mm | 0 | 5 | stiffening per depth | |" in index.replace("  ", " ")
    assert "| `radius_mm` | mm | 0.1 | 100 | radius of the tip | 3 |" in text
    assert all(f"## `{name}`\n" in text for name in LAWS)


def test_a_cause_stands_in_the_reference_with_its_smallest_size_and_what_to_do() -> None:
    text = fill("<!-- generated: causes -->")
    substrate = text.partition("## `substrate` (substrate_per_mm3)\n")[2].partition("\n## ")[0]
    assert "Something stiff lies below: the force grows by 1 + `substrate_per_mm3` x^3." in substrate
    assert "- what to do: measure over thicker tissue" in substrate
    assert "- acts: in the elastic law\n" in substrate
    assert "- acts: at `guide`\n" in text.partition("## `friction`\n")[2].partition("\n## ")[0]
    assert "| `substrate_per_mm3` | 1/mm^3 | 0 | 0 | 0.05 | 2e-05 | growth of force by depth cubed |" in substrate
    assert "## `elastic_law` (exponent)\n" in text
    assert "## `elastic_law` (quadratic_per_mm)\n" in text
    assert all(f"| `{key}` |" in text for key in CAUSES)


def test_what_import_rig_offers_stands_in_the_reference() -> None:
    text = fill("<!-- generated: python -->")
    assert "## `rig.open(place: str | Path, mapping: str | Path | None=None, only: str='') -> SessionData`" in text
    assert "Raises DataError or UsageError where there is none" in " ".join(text.split())
    trial = text.partition("## class `rig.TrialData`\n")[2].partition("\n## ")[0]
    assert "### `arrow(stream: str='force') -> pa.Table`" in trial
    assert "### `name`\n" in trial
    assert "self" not in trial


def test_a_mark_without_a_generator_is_an_error() -> None:
    with pytest.raises(KeyError):
        fill("<!-- generated: nothing -->")


def marks(text: str) -> set[str]:
    """All that look like one, also where nothing would fill them."""
    return set(re.findall(r"<!-- generated: (.+?) -->", text))


def test_every_mark_of_a_page_is_filled() -> None:
    found = set[str]().union(*(marks(page.read_text()) for page in PAGES.rglob("*.md")))
    assert found == GENERATORS.keys()
    assert all(MARK.fullmatch(f"<!-- generated: {name} -->") for name in found)
    assert not MARK.search("<!-- generated: axis causes -->") and marks("<!-- generated: axis causes -->")
