"""What a plug-in declares as a product is looked at before it can spoil the reading of any `rig.toml`."""

from typing import ClassVar, Literal

import pytest
from pydantic import Field

from rig.config.products.input_role import InputProduct
from rig.config.products.registry import ROLES
from rig.config.products.roles import AxisProduct, ForceProduct, MockPort, Product, TrackerProduct
from rig.config.products.usable import refusal_of
from rig.input_streams import InputChannel

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


class Rangeless(ForceProduct):
    """Nobody knows what it bears."""

    driver: ClassVar[str] = "acme.device:open_sensor"
    advice: ClassVar[str] = "force.port"
    product: Literal["acme"] = Field(default="acme", description="what stands on the bench")


class Mocked(Whole):
    """Its mock is a name, where a port is needed."""

    mock = "acme.mock:make"  # type: ignore[assignment]


class Timeless(Whole):
    """A rate that is none."""

    @property
    def promised_Hz(self) -> float:
        return float("nan")


class Pedal(InputProduct):
    """An input that says neither what it brings nor how often."""

    driver: ClassVar[str] = "acme.device:open_pedal"
    advice: ClassVar[str] = "its port"
    product: Literal["acme"] = Field(default="acme", description="what it is")


class Misnamed(Pedal):
    """A channel that no recording can hold."""

    @property
    def channels(self) -> tuple[InputChannel, ...]:
        return (InputChannel("Pressed!", "1", "1: down"),)

    @property
    def nominal_Hz(self) -> float:
        return 0.0


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
        (Driverless, "Driverless has no driver and no advice and no range_N"),
        (Undescribed, "Undescribed describes no matrix: each key needs a description"),
        (Elsewhere, "Elsewhere.port is not mock by default"),
        (Rangeless, "Rangeless has no range_N and no range_N_m"),
        (Mocked, "Mocked.mock is 'acme.mock:make', where a MockPort is expected"),
        (Timeless, "Timeless has a nominal rate of nan Hz, where a number above 0 is expected"),
    ],
)
def test_what_is_no_product_is_said(declared: object, sentence: str) -> None:
    with pytest.raises(AssertionError, match=sentence):
        raise AssertionError(refusal(declared))


@pytest.mark.parametrize(
    ("declared", "sentence"),
    [(Pedal, "Pedal has no channels and no nominal_Hz"), (Misnamed, "'Pressed!' is no name of a channel")],
)
def test_an_input_that_does_not_say_what_it_brings_is_said(declared: object, sentence: str) -> None:
    assert sentence in refusal_of(InputProduct)(declared)


def test_a_key_without_default_is_a_failure_of_the_plug_in() -> None:
    with pytest.raises(ValueError, match="licence"):
        refusal(Required)
