"""One declaration a product: what it says of itself is true of the packages that it names."""

from pkgutil import resolve_name

import pytest

from mock_devices.bench import Bench
from mock_devices.devices import DeviceFactory
from mock_devices.parameters import Parameters
from mock_devices.played import CHOICES
from rig.config.endpoints import Endpoints
from rig.config.products.registry import AXES, FORCE_SENSORS, ROLES, TRACKERS, choice_of, name_of, read
from rig.config.products.robotiq_ft300 import Ft300Wiring
from rig.config.products.roles import Product
from rig.config.table import merged, parse
from rig.config.wiring import Wiring
from rig.errors import UsageError
from rig.registry import Registry

PRODUCTS = [(role, product) for role, products in ROLES.items() for product in products.values()]
each_product = pytest.mark.parametrize(("role", "product"), PRODUCTS, ids=lambda item: getattr(item, "__name__", item))


def wiring(*settings: str) -> Wiring:
    return parse(Wiring, merged({}, settings), "rig.toml")


@each_product
def test_each_is_chosen_by_the_one_line_with_its_name(role: str, product: type[Product]) -> None:
    assert type(getattr(wiring(f"{role}.product={name_of(product)}"), role)) is product


@each_product
def test_each_has_a_driver_and_says_where_to_look(role: str, product: type[Product]) -> None:
    assert callable(resolve_name(product.driver))
    assert f"{role}.port" in product.advice


@each_product
def test_each_mock_is_made_by_the_workshop(role: str, product: type[Product]) -> None:
    assert product.mock
    factory = DeviceFactory(Bench(Parameters()), 0, lambda: 0, seed=0)
    made = resolve_name(product.mock.maker)(factory)
    assert any(device.role == product.mock.role and product.mock.kind in device.mock.endpoints() for device in made)
    for device in made:
        device.mock.close()
    printed = {
        "control": "",
        "pid": 1,
        "serials": {},
        "latency_ms": {},
        product.mock.role: {product.mock.kind: "there"},
    }
    assert product.mock.address(Endpoints.model_validate(printed)).endswith("there")
    assert CHOICES[role][name_of(product)] == (product,)


@each_product
def test_what_a_product_needs_of_other_keys_is_valid_there(role: str, product: type[Product]) -> None:
    for section, values in product.patience.items():
        settings = [f"{section}.{key}={value}" for key, value in values.items()]
        assert wiring(f"{role}.product={name_of(product)}", *settings)


def test_an_unknown_product_is_answered_with_the_nearest_and_all() -> None:
    with pytest.raises(UsageError) as refusal:
        wiring("force.product=robotik-ft300")
    assert str(refusal.value) == (
        "rig.toml: force.product: unknown product 'robotik-ft300'; nearest: robotiq-ft300;"
        " all: bota-sensone, laumas-tlb, robotiq-ft300"
    )


@pytest.mark.parametrize(
    ("setting", "sentence"),
    [
        ("rate_Hz=50", r"force.rate_Hz: Input should be greater than or equal to 99 \(got 50\)"),
        ("baud=9600", r"force.baud: Input should be 0 or 19200 \(got 9600\)"),
        ("bauds=0", "unknown key force.bauds; nearest valid key: baud"),
        ("compression=up", r"force.compression: Input should be 'positive' or 'negative' \(got 'up'\)"),
    ],
)
def test_a_wrong_key_of_a_product_is_named_as_it_stands_in_the_file(setting: str, sentence: str) -> None:
    with pytest.raises(UsageError, match=f"^rig.toml: {sentence}$"):
        wiring("force.product=robotiq-ft300", f"force.{setting}")


def test_a_table_without_a_product_is_the_usual_one() -> None:
    assert wiring("force.port=/dev/ttyUSB0").force.product == "bota-sensone"
    assert (wiring("axis.node=2").axis.product, next(iter(AXES)), next(iter(TRACKERS))) == (
        "maxon-epos4", "maxon-epos4", "ndi-polaris",
    )  # fmt: skip


def test_a_product_reads_back_from_what_a_recording_keeps() -> None:
    kept = wiring("force.product=robotiq-ft300", "force.latency_ms=3")
    assert read(FORCE_SENSORS, kept.force.model_dump_json()) == Ft300Wiring(latency_ms=3.0)
    assert Wiring.model_validate_json(kept.model_dump_json()) == kept


def test_the_fixed_rate_of_the_slow_sensor_is_not_the_rate_that_is_asked_for() -> None:
    assert (wiring("force.rate_Hz=500").force.sampled_Hz, Ft300Wiring(rate_Hz=500).sampled_Hz) == (500.0, 100.0)


def test_a_name_is_registered_once() -> None:
    products = Registry[type[Product]]("force sensor", name_of, FORCE_SENSORS.values())
    with pytest.raises(ValueError, match="there is a force sensor 'robotiq-ft300' already"):
        products.register(Ft300Wiring)
    with pytest.raises(UsageError, match=r"unknown force sensor 'bota'; nearest .*: bota-sensone; all: bota"):
        products.named("bota")
    assert choice_of({"one": Ft300Wiring}) is Ft300Wiring
