"""What a plug-in declares as a product is looked at before it can spoil the reading of any `rig.toml`."""

from typing import ClassVar, Literal

import pytest
from pydantic import Field

from rig.config.products.registry import ROLES
from rig.config.products.roles import AxisProduct, ForceProduct, MockPort, Product, TrackerProduct
from rig.config.products.usable import refusal_of

refusal = refusal_of(ForceProduct)


class Whole(ForceProduct):
    """A sensor with an option of its own."""

    driver: ClassVar[str] = "acme.device:open_sensor"
    advice: ClassVar[str] = "force.port"
    range_N: ClassVar[float] = 10.0
    range_N_m: ClassVar[float] = 1.0

    product: Literal["acme"] = Field(default="acme", description="what stands on the bench")
    rate_Hz: float = Field(default=7000.0, ge=10, le=7000, description="samples a second")
    counts_per_N: float = Field(default=1e6, gt=0, description="of its converter")


class Undescribed(Whole):
    """A key nobody can understand."""

    matrix: tuple[float, ...] = ()


class Required(Whole):
    """A key without a default."""

    licence: str = Field(description="of the maker")


class Elsewhere(Whole):
    """One with a mock that would never be asked for."""

    mock: ClassVar[MockPort | None] = MockPort("acme.mock:make", "acme")
    port: str = Field(default="/dev/ttyACM0", description="where it is plugged in")


class Driverless(ForceProduct):
    """Nobody opens it."""

    product: Literal["acme"] = Field(default="acme", description="what stands on the bench")


class Nameless(ForceProduct):
    """Nobody can choose it."""

    driver: ClassVar[str] = "acme.device:open_sensor"
    advice: ClassVar[str] = "force.port"


def test_a_whole_product_is_usable_at_its_own_rate() -> None:
    assert refusal(Whole) == ""
    assert Whole(rate_Hz=7000).sampled_Hz == 7000.0


@pytest.mark.parametrize("role", ROLES)
def test_ours_pass_the_same_gate(role: str) -> None:
    roles: dict[str, type[Product]] = {"force": ForceProduct, "axis": AxisProduct, "tracker": TrackerProduct}
    for product in ROLES[role].values():
        assert refusal_of(roles[role])(product) == ""


@pytest.mark.parametrize(
    ("declared", "sentence"),
    [
        (7, "is 7, where a subclass of ForceProduct is expected"),
        (TrackerProduct, "is <class .*TrackerProduct'>, where a subclass of ForceProduct is expected"),
        (Nameless, "Nameless.product has no default"),
        (Driverless, "Driverless has no driver and no advice"),
        (Undescribed, "Undescribed describes no matrix: each key needs a description"),
        (Elsewhere, "Elsewhere.port is not mock by default"),
    ],
)
def test_what_is_no_product_is_said(declared: object, sentence: str) -> None:
    with pytest.raises(AssertionError, match=sentence):
        raise AssertionError(refusal(declared))


def test_a_key_without_default_is_a_failure_of_the_plug_in() -> None:
    with pytest.raises(ValueError, match="licence"):
        refusal(Required)
