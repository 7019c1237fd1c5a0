"""Whether what a plug-in declares as a product is one: looked at before it can become a choice in `rig.toml`."""

from collections.abc import Callable
from typing import cast

from pydantic import TypeAdapter

from rig.config.products.roles import MOCK_PORT, Product
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
    missing = [what for what in ("driver", "advice") if not isinstance(getattr(product, what, None), str)]
    if missing:
        return f"{product.__name__} has no {' and no '.join(missing)}"
    undescribed = [key for key, field in product.model_fields.items() if key != "product" and not field.description]
    if undescribed:
        return f"{product.__name__} describes no {', '.join(undescribed)}: each key needs a description"
    # All keys have defaults, and the schema can be built, or no table of any product could be read.
    TypeAdapter(product)
    usual = product()
    return "" if usual.port == MOCK_PORT or not product.mock else f"{product.__name__}.port is not mock by default"
