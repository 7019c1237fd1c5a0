"""The files of `examples/deploy` are what the programs that read them take, where these are installed."""

import re
import shutil
import subprocess
import sys
from pathlib import Path

import pytest
from typer.main import get_command

from api.cli.app import build
from api.http.priority import NICE
from rig.config.wiring import Wiring

DEPLOY = Path(__file__).parents[1] / "examples" / "deploy"
PAGE = Path(__file__).parents[1] / "docs" / "how-to" / "deploy.md"
UNIT = (DEPLOY / "tissue-rig.service").read_text()
RULES = (DEPLOY / "70-tissue-rig.rules").read_text()
# udev(7): a key, an operator, a value in quotation marks.
PART = re.compile(r'[A-Z_]+(\{[^}"]+\})?(==|!=|=|\+=|-=|:=)"[^"]*"')
MATCHED, ASSIGNED = {"ACTION", "SUBSYSTEM", "KERNEL", "DRIVERS", "ATTRS", "SYMLINK"}, {"GROUP", "MODE", "ATTR", "ENV"}


def without(program: str) -> pytest.MarkDecorator:
    return pytest.mark.skipif(shutil.which(program) is None, reason=f"no {program} here")


def said_of_unit(text: str, folder: Path) -> str:
    """What systemd says of the unit, with a program that is there."""
    file = folder / "tissue-rig.service"
    file.write_text(text.replace("/opt/tissue-rig/bin/rig", str(Path(sys.executable).with_name("rig"))))
    done = subprocess.run(
        ["systemd-analyze", "verify", file], capture_output=True, text=True, timeout=60, check=False
    )  # fmt: skip
    return done.stderr + done.stdout + ("" if done.returncode == 0 else f"exit code {done.returncode}")


@without("systemd-analyze")
def test_systemd_takes_the_unit(tmp_path: Path) -> None:
    assert said_of_unit(UNIT, tmp_path) == ""


@without("systemd-analyze")
@pytest.mark.parametrize(
    ("right", "wrong"),
    [("KillMode=mixed", "KillMode=mix"), ("LimitRTPRIO=60", "LimitRtPrio=60"), ("/opt/tissue-rig/bin/rig", "/no/rig")],
)
def test_systemd_says_what_is_wrong_with_a_unit(right: str, wrong: str, tmp_path: Path) -> None:
    assert right in UNIT
    assert said_of_unit(UNIT.replace(right, wrong), tmp_path) != ""


def commands(text: str) -> list[list[str]]:
    """Of `rig serve`, as units have them."""
    joined = text.replace("\\\n", " ")
    return [line.split()[2:] for line in re.findall(r"^ExecStart=(\S*/rig serve .*)$", joined, re.MULTILINE)]


def test_what_units_start_is_what_the_command_takes() -> None:
    found = [*commands(UNIT), *commands(PAGE.read_text())]
    assert len(found) == 2
    for words in found:
        get_command(build("serve")).commands["serve"].make_context("serve", words)  # type: ignore[attr-defined]


def not_absolute(text: str) -> list[str]:
    """Of what the bench's account runs: places that depend on where the person stands who types it."""
    found = list[str]()
    for line in re.findall(r"^sudo -u rig \S+/rig (.+)$", text, re.MULTILINE):
        name, *words = line.split()
        command = get_command(build(name)).commands[name]  # type: ignore[attr-defined]
        given = command.make_context(name, words).params
        places = [place for place in given.values() if isinstance(place, Path)]
        found += [f"{name}: {place}" for place in places if not place.is_absolute()]
    return found


def test_what_the_account_of_the_bench_runs_is_right_wherever_it_is_typed() -> None:
    text = PAGE.read_text()
    assert text.count("\nsudo -u rig ") >= 2 and not_absolute(text) == []
    planted = "sudo -u rig /opt/tissue-rig/bin/rig catalogue backup names.json\n"
    assert not_absolute(planted) == ["catalogue: names.json", "catalogue: sessions"]


def test_the_unit_grants_what_the_loop_asks_for_and_homes_nothing_by_itself() -> None:
    (granted,) = re.findall(r"^LimitRTPRIO=(\d+)$", UNIT, re.MULTILINE)
    assert int(granted) > Wiring().loop.priority
    limits = re.findall(r"^(?:LimitNICE=|@dialout - nice )(-\d+)$", UNIT + PAGE.read_text(), re.MULTILINE)
    assert list(map(int, limits)) == [NICE, NICE], "setpriority(2) refuses what is beyond the limit, and grants no part"
    assert "\nRestart=no\n" in UNIT
    assert "[Install]" not in re.sub(r"^#.*$", "", UNIT, flags=re.MULTILINE)


def test_a_computation_that_is_ended_for_its_memory_does_not_end_the_bench() -> None:
    """`systemd.service(5)`: without it the unit is ended with the first process of it that the system ends."""
    assert "\nOOMPolicy=continue\n" in UNIT


def refused_of_rules(text: str) -> list[str]:
    """Parts that are no part of a rule, and assignments that match or matches that assign."""
    lines = [line for line in text.splitlines() if line and not line.startswith("#")]
    wrong = []
    for part in (part for line in lines for part in line.split(", ")):
        found = PART.fullmatch(part)
        key = re.match(r"[A-Z_]+", part)
        assigns = found is not None and "=" in found[2] and found[2] not in ("==", "!=")
        if not found or not key or key[0] in (MATCHED - {"SYMLINK"} if assigns else ASSIGNED):
            wrong.append(part)
    return wrong


def test_rules_have_the_form_of_rules() -> None:
    assert refused_of_rules(RULES) == []
    assert refused_of_rules('SUBSYSTEM="tty", GROUP=="dialout", MODE=0660') == [
        'SUBSYSTEM="tty"', 'GROUP=="dialout"', "MODE=0660"
    ]  # fmt: skip


@without("udevadm")
def test_udev_takes_the_rules() -> None:
    done = subprocess.run(["udevadm", "verify", "--help"], capture_output=True, text=True, timeout=60, check=False)
    if done.returncode:
        pytest.skip("this udevadm is older than 254, which verifies rules")
    subprocess.run(["udevadm", "verify", DEPLOY / "70-tissue-rig.rules"], timeout=60, check=True)


@without("caddy")
def test_caddy_takes_its_file() -> None:
    subprocess.run(["caddy", "validate", "--config", DEPLOY / "Caddyfile"], timeout=60, check=True)


def test_the_page_names_every_file() -> None:
    assert [file.name for file in DEPLOY.iterdir() if f"examples/deploy/{file.name}" not in PAGE.read_text()] == []
