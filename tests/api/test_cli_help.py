"""Every command explains itself with an example, and wrong use is one sentence with exit code 2."""

import re
import socket
from importlib.metadata import version
from pathlib import Path

import pytest
from typer.testing import CliRunner

from api.cli.app import COMMANDS, build
from rig.errors import BadTrial, CheckFailed, SafetyStop, UsageError

runner = CliRunner()


@pytest.mark.parametrize("name", COMMANDS)
def test_help_of_every_command_ends_with_an_example_of_that_command(name: str) -> None:
    answer = runner.invoke(build(name), [name, "--help"], terminal_width=200)
    assert answer.exit_code == 0
    assert re.search(rf"Example:\s+rig {name} ?", answer.output), answer.output


def test_help_of_the_whole_lists_every_command_with_its_whole_first_sentence() -> None:
    answer = runner.invoke(build(), ["--help"], terminal_width=200)
    for name in COMMANDS:
        (listed,) = re.findall(rf"^ *{name} +(.*)$", answer.output, re.MULTILINE)
        assert f"  {listed}\n" in runner.invoke(build(name), [name, "--help"], terminal_width=200).output


def test_the_codes_a_command_ends_with_stand_in_the_help() -> None:
    text = " ".join(runner.invoke(build(), ["--help"], terminal_width=200).output.split())
    for error in (CheckFailed, UsageError, SafetyStop, BadTrial):
        assert re.search(rf"\b{error.exit_code} \w+", text.partition("Exit codes: 0 ok")[2]), error
    assert "4 a bad trial remained, 130 interrupted" in text


def test_the_version_is_that_of_the_package() -> None:
    assert runner.invoke(build(), ["--version"]).output == f"tissue-rig {version('tissue-rig')}\n"


@pytest.mark.parametrize(
    "arguments", [["no-such-command"], ["verify"], ["fit", "a", "--no-such-option"], ["serve", "--port", "0"]]
)
def test_wrong_use_ends_with_code_2(arguments: list[str]) -> None:
    assert runner.invoke(build(arguments[0]), arguments).exit_code == 2


def test_a_port_that_is_taken_is_one_sentence_before_the_bench_starts(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("api.cli.serve.bench_for", lambda _: pytest.fail("a bench was started"))
    with socket.create_server(("127.0.0.1", 0)) as taken:
        answer = runner.invoke(build("serve"), ["serve", "--port", str(taken.getsockname()[1])])
    assert isinstance(answer.exception, UsageError)
    assert "Address already in use; end what listens there, or give another port" in str(answer.exception)


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (["fit", "no-such-session"], "no-such-session"),
        (["report", "no-such-session"], "no-such-session"),
        (["verify", "no-such-session"], "no-such-session"),
        (["import", "no-such-folder", "--out", "x"], "no-such-folder"),
        (["export", "no-such-session", "--out", "x"], "no-such-session"),
        (["capture", "no-such.toml", "--out", "x"], "no-such.toml: no such file"),
        (["doctor", "--config", "no-such.toml"], "no-such.toml: no such file"),
        (["doctor", "--set", "force"], "write section.key=value"),
        (["track", "--model", "no-such.json", "--force", "5"], "no-such.json: no such file"),
        (["serve", "--host", "0.0.0.0"], "others on the network would read tokens and passwords"),
    ],
)
def test_a_wrong_file_or_setting_is_one_sentence(
    arguments: list[str], words: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    answer = runner.invoke(build(arguments[0]), arguments)
    assert isinstance(answer.exception, UsageError)
    assert words in str(answer.exception)
    assert answer.exception.exit_code == 2
    assert list(tmp_path.iterdir()) == []
