"""Inputs whose port says `mock`: which of them the mock bench is to serve."""

from rig.config.products.roles import MOCK_PORT, Product
from rig.config.wiring import Wiring
from rig.errors import UsageError


def mock_inputs(wiring: Wiring) -> dict[str, Product]:
    """The inputs that the mock bench is to serve, by name; raises UsageError where it cannot serve one."""
    found: dict[str, Product] = {name: each for name, each in wiring.input.items() if each.port == MOCK_PORT}
    for name, each in found.items():
        if each.mock is None:
            raise UsageError(
                f"input.{name}.port mock: the mock bench has no {each.product}; give the port of a real one"
            )
    return found


def input_options(wiring: Wiring) -> list[str]:
    """What the mock bench is told of them."""
    products = dict.fromkeys(each.product for each in mock_inputs(wiring).values())
    return [word for product in products for word in ("--input", product)]
