"""Every tissue law by its name, as `model.json` and `rig fit --laws` know it."""

from collections.abc import Mapping, Sequence

from rig.errors import UsageError
from rig.plugins import subclass_of
from rig.registry import Registry
from rig.tissue.laws import Constant, Index, Law
from rig.tissue.laws_elastic import Fung, Layer, Power, Quadratic
from rig.tissue.laws_extended import Extended
from rig.tissue.laws_viscous import HuntCrossley, Prony, QuasiLinear, StandardLinear


def refusal(item: object) -> str:
    """Why an object is no tissue law; "" where it is one."""
    wrong = subclass_of(Law)(item)
    if wrong or not isinstance(item, type):
        return wrong
    lacking = sorted(getattr(item, "__abstractmethods__", ()))
    lacking += [name for name in ("name", "formula", "bounds") if not getattr(item, name, None)]
    return f"{item.__name__} has no {', '.join(lacking)}" if lacking else ""


COMPARED: tuple[type[Law], ...] = (Constant, Index)
THREE_PARAMETER: tuple[type[Law], ...] = (Quadratic, Power, Fung)
OTHERS: tuple[type[Law], ...] = (Layer, HuntCrossley, StandardLinear, Prony, QuasiLinear, Extended)
LAWS = Registry[type[Law]](
    "tissue law", lambda law: law.name, (*COMPARED, *THREE_PARAMETER, *OTHERS), "tissue_rig.law", refusal
)
ALSO = {"kelvin_voigt": Constant.name}


def law_named(name: str) -> type[Law]:
    """The law's class; raises UsageError naming the laws there are."""
    return LAWS.named(ALSO.get(name, name))


def check_known(known: Mapping[str, float], laws: Sequence[type[Law]]) -> None:
    """Raises UsageError for a parameter that none of ``laws`` has, and for a value beyond a law's bounds."""
    names = dict.fromkeys(parameter for law in laws for parameter in law.bounds)
    for name, value in known.items():
        if name not in names:
            raise UsageError(f"{name}={value:g}: the laws compared have {', '.join(names)}; add others by laws")
        for law in laws:
            bounds = law.bounds.get(name)
            if bounds and not bounds.lower <= value <= bounds.upper:
                raise UsageError(
                    f"{name}={value:g}: {law.name} takes {bounds.lower:g} to {bounds.upper:g} {bounds.unit}"
                )
