"""Tables of inputs in `rig.toml`: what they declare, and each wrong one with its sentence."""

from pkgutil import resolve_name
from typing import Any

import pytest

from rig.config.products.input_role import InputProduct
from rig.config.products.inputs import INPUTS
from rig.config.table import merged, parse
from rig.config.wiring import Wiring
from rig.errors import UsageError
from rig.input_streams import MOST_INPUTS, input_streams


def wired(inputs: dict[str, Any], *settings: str) -> Wiring:
    return parse(Wiring, merged({"input": inputs}, settings), "rig.toml")


@pytest.mark.parametrize("name", list(INPUTS))
def test_each_product_declares_what_the_bench_needs(name: str) -> None:
    product = wired({"one": {"product": name}}).input["one"]
    assert type(product) is INPUTS[name]
    assert callable(resolve_name(product.driver))
    assert product.mock and callable(resolve_name(product.mock.maker))
    (stream,) = input_streams({"one": product.channels})
    assert not product.switch or product.switch in stream.kinds
    assert not product.is_needed and product.nominal_Hz in (0.0, 50.0)
    assert Wiring.model_validate_json(wired({"one": {"product": name}}).model_dump_json()).input["one"] == product


def test_a_table_says_whether_motion_depends_on_it() -> None:
    found = wired({
        "a": {"product": "evdev-switch", "port": "/dev/a"},
        "b": {"product": "evdev-switch", "port": "/dev/b", "stops": "pain"},
        "c": {"product": "lsl-stream", "port": "x", "needed": True},
    })  # fmt: skip
    assert {name: one.is_needed for name, one in found.input.items()} == {"a": False, "b": True, "c": True}
    assert found.input["b"].asks_for == "pain"


@pytest.mark.parametrize(
    ("inputs", "sentence"),
    [
        ({"force": {}}, "input.force: is no name of an input"),
        ({"My": {}}, "input.My: is no name of an input: at most 24 small letters"),
        ({"a": {"produkt": "x"}}, "unknown key input.a.produkt; nearest valid key: product"),
        ({"a": {"product": "glove"}}, "input.a.product: unknown product 'glove'; nearest: firmata-glove"),
        ({"a": {"port": "/dev/x"}, "b": {"port": "/dev/x"}}, "input.b: /dev/x is input.a already"),
        ({"a": {}, "b": {}}, "input.b: firmata-glove mock is input.a already"),
        ({"a": {"fingers": {"t": 1, "u": 1}}}, "two force sensors on one analogue input"),
        ({"a": {"fingers": {"t": 16}}}, "less than 16"),
        ({"a": {"fingers": {"T": 1}}}, "'T_N' is no name of a channel"),
        ({"a": {"fingers": {}}}, "0 channels; a sample takes 1 to 22"),
        ({"a": {"interval_ms": 5}}, "greater than or equal to 10"),
        ({"a": {"product": "evdev-switch", "key": "zz"}}, "no key 'zz': write a number"),
        ({"a": {"product": "evdev-switch", "stops": "now"}}, "'stop', 'pain' or 'emergency'"),
        ({"a": {"product": "lsl-stream", "units": {"seq": "1"}}}, "'seq' is no name of a channel"),
        ({"a": {"product": "lsl-stream", "rate_Hz": -1.0}}, "greater than or equal to 0"),
        ({f"i{number}": {"port": f"/dev/{number}"} for number in range(MOST_INPUTS + 1)}, "17 inputs; a recording"),
    ],
)
def test_each_wrong_table_has_its_sentence(inputs: dict[str, Any], sentence: str) -> None:
    with pytest.raises(UsageError) as refusal:
        wired(inputs)
    assert sentence in str(refusal.value)


def test_the_keypad_of_the_stop_process_is_no_input_as_well() -> None:
    pedal = {"product": "evdev-switch", "port": "/dev/pedal"}
    with pytest.raises(UsageError, match=r"input.a: /dev/pedal is stop.keypad already"):
        wired({"a": pedal}, "stop.keypad=/dev/pedal")
    assert wired({"a": pedal}, "stop.keypad=/dev/other").input


def test_a_mock_input_is_one_more_reason_for_the_mock_bench() -> None:
    real = ("force.port=/dev/f", "axis.port=/dev/a", "tracker.port=/dev/t")
    assert not wired({"a": {"port": "/dev/g"}}, *real).uses_mock
    assert wired({"a": {}}, *real).uses_mock


def test_a_product_says_its_channels_and_rate_itself() -> None:
    class Bare(InputProduct):
        driver = "x:y"
        advice = ""

    with pytest.raises(NotImplementedError):
        _ = Bare().channels
    with pytest.raises(NotImplementedError):
        _ = Bare().nominal_Hz


def test_a_threshold_of_a_site_holds_there_and_never_raises_the_subjects_own() -> None:
    def limit_N(site: str, found_N: float, own_N: float = 15.0) -> float:
        subject = {"site": site, "pain_threshold_N": own_N, "site_thresholds_N": {"calf": found_N}}
        return Wiring.model_validate({"subject": subject}).force_limit_N

    assert limit_N("calf", 8.2) == 8.2
    assert limit_N("forearm", 8.2) == 15.0
    assert limit_N("calf", 18.0) == 15.0
    assert limit_N("calf", 30.0, own_N=25.0) == 20.0  # limits.force_N
    with pytest.raises(ValueError, match="less than or equal to 50"):
        limit_N("calf", 51.0)
