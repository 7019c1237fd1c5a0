"""Every tissue law by its name, as `model.json` and `rig fit --laws` know it."""

from rig.errors import UsageError
from rig.tissue.laws import Constant, Index, Law
from rig.tissue.laws_elastic import Fung, Layer, Power, Quadratic
from rig.tissue.laws_extended import Extended
from rig.tissue.laws_viscous import HuntCrossley, Prony, QuasiLinear, StandardLinear

COMPARED: tuple[type[Law], ...] = (Constant, Index)
RIVALS: tuple[type[Law], ...] = (Quadratic, Power, Fung)
OTHERS: tuple[type[Law], ...] = (Layer, HuntCrossley, StandardLinear, Prony, QuasiLinear, Extended)
LAWS: dict[str, type[Law]] = {law.name: law for law in (*COMPARED, *RIVALS, *OTHERS)}
ALSO = {"kelvin_voigt": Constant.name}


def law_named(name: str) -> type[Law]:
    """The law's class; raises UsageError naming the laws there are."""
    known = ALSO.get(name, name)
    if known not in LAWS:
        raise UsageError(f"no tissue law is called {name!r}; choose one of {', '.join(sorted([*LAWS, *ALSO]))}")
    return LAWS[known]
