"""Every tissue law by its name, as `model.json` and `rig fit --laws` know it."""

from rig.registry import Registry
from rig.tissue.laws import Constant, Index, Law
from rig.tissue.laws_elastic import Fung, Layer, Power, Quadratic
from rig.tissue.laws_extended import Extended
from rig.tissue.laws_viscous import HuntCrossley, Prony, QuasiLinear, StandardLinear

COMPARED: tuple[type[Law], ...] = (Constant, Index)
RIVALS: tuple[type[Law], ...] = (Quadratic, Power, Fung)
OTHERS: tuple[type[Law], ...] = (Layer, HuntCrossley, StandardLinear, Prony, QuasiLinear, Extended)
LAWS = Registry[type[Law]]("tissue law", lambda law: law.name, (*COMPARED, *RIVALS, *OTHERS))
ALSO = {"kelvin_voigt": Constant.name}


def law_named(name: str) -> type[Law]:
    """The law's class; raises UsageError naming the laws there are."""
    return LAWS.named(ALSO.get(name, name))
