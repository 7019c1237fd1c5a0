"""Whether what a plug-in declares as a product is one: looked at before it can become a choice in `rig.toml`."""

import math
from collections.abc import Callable
from numbers import Real
from typing import cast

from pydantic import TypeAdapter

from rig.config.products.input_role import InputProduct, channel_trouble
from rig.config.products.roles import MOCK_PORT, ForceProduct, MockPort, Product
from rig.plugins import subclass_of


def refusal_of(role: type[Product]) -> Callable[[object], str]:
    """What says why an object cannot fill ``role``; "" where it can."""

    def refusal(item: object) -> str:
        wrong = subclass_of(role)(item)
        return wrong or _lacking(cast(type[Product], item))

    return refusal


def _lacking(product: type[Product]) -> str:
    name = product.model_fields["product"].default
    if not isinstance(name, str) or not name:
        return f"{product.__name__}.product has no default: give it the name that stands in rig.toml"
    if missing := _missing(product):
        return f"{product.__name__} has no {' and no '.join(missing)}"
    mock: object = product.mock
    if not isinstance(mock, MockPort | None):
        return f"{product.__name__}.mock is {mock!r}, where a MockPort is expected"
    undescribed = [key for key, field in product.model_fields.items() if key != "product" and not field.description]
    if undescribed:
        return f"{product.__name__} describes no {', '.join(undescribed)}: each key needs a description"
    # All keys have defaults, and the schema can be built, or no table of any product could be read.
    TypeAdapter(product)
    usual = product()
    if product.mock and usual.port != MOCK_PORT:
        return f"{product.__name__}.port is not mock by default"
    return _unsound(usual)


def _missing(product: type[Product]) -> list[str]:
    """What the class itself has to say, of the right type, and does not."""
    numbers = ("range_N", "range_N_m") if issubclass(product, ForceProduct) else ()
    wanted = {"driver": str, "advice": str, **dict.fromkeys(numbers, Real)}
    missing = [what for what, kind in wanted.items() if not isinstance(getattr(product, what, None), kind)]
    own = ("channels", "nominal_Hz") if issubclass(product, InputProduct) else ()
    return missing + [what for what in own if getattr(product, what) is getattr(InputProduct, what)]


def _unsound(usual: Product) -> str:
    name, rate_Hz = type(usual).__name__, usual.promised_Hz
    if rate_Hz is not None and not (isinstance(rate_Hz, int | float) and 0 < rate_Hz < math.inf):
        return f"{name} has a nominal rate of {rate_Hz!r} Hz, where a number above 0 is expected"
    return channel_trouble(usual.channels) if isinstance(usual, InputProduct) else ""
