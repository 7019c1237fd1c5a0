"""`rig token` on the command line."""

import os
import subprocess
from pathlib import Path

import pytest
from typer.testing import CliRunner, Result

from api.cli.app import build
from api.http.access.scopes import Scope
from api.http.access.tokens import TokenStore, access_folder
from mock_devices.testing.commands import RIG, ROOT
from rig.errors import DeviceError, UsageError

runner = CliRunner()


@pytest.fixture(autouse=True)
def own_folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("XDG_STATE_HOME", str(tmp_path))


def token(*arguments: str) -> Result:
    return runner.invoke(build("token"), ["token", *arguments])


def test_a_token_is_printed_alone_on_standard_output_listed_without_it_and_revoked() -> None:
    command = [*RIG, "token", "create", "notebook", "--scope", "read"]
    done = subprocess.run(
        command, env=os.environ | {"PYTHONPATH": str(ROOT)}, capture_output=True, text=True, check=True
    )
    (secret,) = done.stdout.splitlines()
    assert "token notebook (read): shown only now" in done.stderr
    found = TokenStore(access_folder()).caller(secret)
    assert found and (found.name, found.scope) == ("notebook", Scope.READ)
    listed = token("list").output
    assert "notebook" in listed and secret not in listed
    assert token("revoke", "notebook").output == "token notebook (read) is revoked\n"
    assert TokenStore(access_folder()).caller(secret) is None


@pytest.mark.parametrize("arguments", [["create"], ["revoke"], ["link"], ["create", "x" * 81]])
def test_a_name_is_needed(arguments: list[str]) -> None:
    answer = token(*arguments)
    assert isinstance(answer.exception, UsageError)
    assert "a name of 1 to 80 letters is needed" in str(answer.exception)


@pytest.mark.parametrize("arguments", [["mend", "x"], ["create", "x", "--scope", "root"]])
def test_what_it_does_not_know_is_wrong_use(arguments: list[str]) -> None:
    assert token(*arguments).exit_code == 2


def test_a_link_of_a_service_that_is_not_there_is_one_sentence() -> None:
    answer = token("link", "Ann", "--port", "1")
    assert isinstance(answer.exception, DeviceError)
    assert "http://127.0.0.1:1" in str(answer.exception)
