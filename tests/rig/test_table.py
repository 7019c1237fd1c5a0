"""Configuration as people write it: what is no number is not made one, and the sentence says where and what."""

from pathlib import Path

import pytest

from rig.config.table import load, merged, parse
from rig.config.wiring import Wiring
from rig.errors import UsageError

EXAMPLE = Path(__file__).parents[2] / "examples" / "forearm.toml"


def wiring(*settings: str) -> Wiring:
    return parse(Wiring, merged({}, settings), "rig.toml")


@pytest.mark.parametrize(
    ("setting", "sentence"),
    [
        ('limits.force_N="5"', r"limits.force_N: Input should be a valid number \(got '5'\)"),
        ("limits.force_N=five", r"limits.force_N: Input should be a valid number \(got 'five'\)"),
        ("limits.force_N=true", r"limits.force_N: Input should be a valid number \(got True\)"),
        ("limits.force_N=nan", r"limits.force_N: Input should be a finite number \(got nan\)"),
        ('axis.node="1"', r"axis.node: Input should be a valid integer \(got '1'\)"),
        ("axis.node=1.0", r"axis.node: Input should be a valid integer \(got 1.0\)"),
        ("subject.id=5", r"subject.id: Input should be a valid string \(got 5\)"),
        ('axis.holds_unpowered="yes"', r"axis.holds_unpowered: Input should be a valid boolean \(got 'yes'\)"),
        ("tracker.tools=[1]", r"tracker.tools.0: Input should be a valid string \(got 1\)"),
    ],
)
def test_text_is_no_number_and_a_number_no_text(setting: str, sentence: str) -> None:
    with pytest.raises(UsageError, match=sentence):
        wiring(setting)


def test_a_whole_number_is_a_number_and_a_list_a_tuple() -> None:
    found = wiring(
        "limits.force_N=5", 'tracker.tools=["tip"]', 'mock.parameters="bench.toml"', "force.port=/dev/ttyUSB0"
    )
    assert isinstance(found.limits.force_N, float)
    assert found.tracker and found.tracker.tools == ("tip",)
    assert found.mock.parameters == Path("bench.toml")
    assert found.force.port == "/dev/ttyUSB0"


def test_a_file_reads_as_written() -> None:
    assert load(Wiring, EXAMPLE).tracker == Wiring().tracker


def test_an_unknown_key_names_the_nearest_valid_one() -> None:
    with pytest.raises(UsageError, match=r"rig.toml: unknown key axis.nodes; nearest valid key: node"):
        wiring("axis.nodes=1")


def test_a_value_is_no_section() -> None:
    with pytest.raises(UsageError, match=r"--set limits.force_N.x=1: force_N is a value, not a section"):
        load(Wiring, EXAMPLE, ["limits.force_N.x=1"])


def test_a_file_that_nests_without_end_is_one_sentence(tmp_path: Path) -> None:
    path = tmp_path / "deep.toml"
    path.write_text("speeds_mm_s = " + "[" * 3000 + "]" * 3000)
    with pytest.raises(UsageError, match=r"deep.toml: nests its values too deeply"):
        load(Wiring, path)
