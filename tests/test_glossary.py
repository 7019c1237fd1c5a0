"""The glossary's table of parameters is what the code declares: the same names, each with one unit."""

import re
from collections.abc import Iterator
from itertools import cycle
from pathlib import Path

from mock_devices.parameters import Tissue
from rig.diagnosis.indentation import DAMPING, STIFFNESS, SURFACE, TIP_ZERO, ZERO, library, nulls
from rig.tissue.laws import Law
from rig.tissue.laws_lattice import LatticeConstant, LatticeIndex
from rig.tissue.laws_springs import LatticeSprings
from rig.tissue.registry import LAWS

PAGE = Path(__file__).parents[1] / "docs" / "reference" / "glossary.md"
ROW = re.compile(r"^\| (`\w+`(?:, `\w+`)*) \| ([^|]+) \|", re.MULTILINE)
LATTICE: tuple[type[Law], ...] = (LatticeConstant, LatticeIndex, LatticeSprings)
# The end of a name that a unit asks for; units with a power of n are spelled out in the law.
ENDINGS = {"1": "", "N/mm^n": "_N_mmn", "N s/mm^(n+1)": "_N_s_mmn1"}


def written() -> dict[str, str]:
    """Unit by name; one unit for all names of a row, or one each."""
    rows = ROW.findall(PAGE.read_text())
    pairs = ((names.replace("`", "").split(", "), cycle(units.strip().split(", "))) for names, units in rows)
    return {name: unit for names, units in pairs for name, unit in zip(names, units, strict=False)}


def declared() -> Iterator[tuple[str, str]]:
    """Name and unit of every parameter of a law and of the simulation."""
    for law in (*LAWS.values(), *LATTICE):
        yield from ((name, bounds.unit) for name, bounds in law.bounds.items())
    effects = (par for effect in library("constant") for par in effect.pars)
    yield from ((par.name, par.unit) for par in (STIFFNESS, DAMPING, SURFACE, ZERO, TIP_ZERO, *effects))


def ending(unit: str) -> str:
    """How a name with this unit ends: `_N_s_mm` for N s/mm, `_per_mm3` for 1/mm^3."""
    return ENDINGS.get(unit, "_" + unit.replace("^", "").replace("1/", "per_").replace("/", "_").replace(" ", "_"))


def test_the_table_holds_every_parameter_with_the_unit_that_all_declare() -> None:
    assert {(name, unit) for name, unit in written().items()} == set(declared())
    assert nulls().keys() <= written().keys()


def test_a_name_ends_in_its_unit_and_one_without_dimension_in_none() -> None:
    for name, unit in declared():
        assert name.endswith(ending(unit)), (name, unit)
        assert unit != "1" or not re.search(r"_(1|N|mm|s|Hz|kg|K)$", name), name


def test_the_mock_bench_takes_its_tissue_by_the_same_names() -> None:
    assert set(Tissue.model_fields) & written().keys() == {"a_N_mm", "b_per_mm", "damping_N_s_mm"}
