"""The recipes for SDKs that nobody here has are run as they stand in the documents, on stand-ins for the SDKs."""

import re
import select
import time
from collections.abc import Callable
from types import SimpleNamespace
from typing import Any

import pytest

from drivers.threaded_source import ThreadedSource
from tests.test_docs import ROOT

PAGE = ROOT / "docs/how-to/write-a-driver.md"
RECIPES = re.findall(r"^```\{code-block\} python\n(.*?)^```$", PAGE.read_text(), re.MULTILINE | re.DOTALL)


class Stood:
    """Notes what is called of it, by the maker's names, and gives what ``gives`` says."""

    def __init__(self, **gives: Callable[..., Any]) -> None:
        self.called: list[str] = []
        self._gives = gives

    def __getattr__(self, name: str) -> Callable[..., Any]:
        def call(*arguments: object, **named: object) -> Any:
            self.called.append(name)
            return self._gives[name](*arguments, **named) if name in self._gives else None

        return call


def bunch(count: int = 10, **_: object) -> list[float]:
    time.sleep(0.005)
    return [0.5] * count


def taken(names: dict[str, Any], recipe: str) -> list[float]:
    """What the recipe's source gives."""
    exec(compile(recipe, str(PAGE), "exec"), names)
    source: ThreadedSource[float] = names["source"]
    source.start()
    if names.get("raise_event"):
        names["raise_event"](12_345)
    try:
        assert select.select([source.fileno()], [], [], 2.0)[0]
        return [one.item for one in source.take()]
    finally:
        assert source.close()


def test_there_are_three() -> None:
    assert [re.findall(r'ThreadedSource\("([\w-]+)"', recipe) for recipe in RECIPES] == [
        ["ni-bridge"], ["labjack"], ["kinesis"],
    ]  # fmt: skip


def test_ni_daq_reads_in_bunches() -> None:
    channels = Stood()
    task = Stood(read=bunch)
    task.__dict__ |= {"ai_channels": channels, "timing": Stood()}
    names = {
        "nidaqmx": SimpleNamespace(Task=lambda: task), "ForceUnits": SimpleNamespace(NEWTONS=1),
        "AcquisitionType": SimpleNamespace(CONTINUOUS=2), "bridge": {"nominal_bridge_resistance": 350.0},
        "ThreadedSource": ThreadedSource,
    }  # fmt: skip
    assert set(taken(names, RECIPES[0])) == {0.5}
    assert channels.called == ["add_ai_force_bridge_two_point_lin_chan"] and task.called[0] == "start"


def test_labjack_streams() -> None:
    ljm = Stood(
        openS=lambda *_: 7, namesToAddresses=lambda *_: ([0], [3]), eStreamRead=lambda _: (bunch(), 0, 0),
    )  # fmt: skip
    assert set(taken({"ljm": ljm, "ThreadedSource": ThreadedSource}, RECIPES[1])) == {0.5}
    assert ljm.called[:3] == ["openS", "namesToAddresses", "eStreamStart"]


class Stage:
    """A .NET device, whose events take handlers by ``+=``."""

    def __init__(self) -> None:
        self.handlers: list[Callable[..., None]] = []
        self.polling_ms = 0

    @property
    def PositionChanged(self) -> "Stage":
        return self

    @PositionChanged.setter
    def PositionChanged(self, _: object) -> None:
        """What `+=` gives back."""

    def __iadd__(self, handler: Callable[..., None]) -> "Stage":
        self.handlers.append(handler)
        return self

    def StartPolling(self, polling_ms: int) -> None:
        self.polling_ms = polling_ms

    def moved(self, position: int) -> None:
        for handler in self.handlers:
            handler(self, SimpleNamespace(Position=position))


def test_kinesis_calls_back() -> None:
    stage = Stage()
    names = {"device": stage, "ThreadedSource": ThreadedSource, "raise_event": stage.moved}
    assert taken(names, RECIPES[2]) == [12_345]
    assert stage.polling_ms == 5


def test_a_recipe_that_is_wrong_fails() -> None:
    with pytest.raises(SyntaxError):
        taken({}, RECIPES[0].replace("**bridge", "..."))
    with pytest.raises(AssertionError):
        taken({"device": Stage(), "ThreadedSource": ThreadedSource}, RECIPES[2])
