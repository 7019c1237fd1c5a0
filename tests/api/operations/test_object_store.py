"""Recordings in an object store: read as those in a folder are; what the store refuses is one sentence."""

import json
import os
import socket
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import fsspec
import pytest
from typer.testing import CliRunner

from api.cli.app import build
from mock_devices.testing.made.synthetic import Bench, write_made_session
from rig.errors import DataError, UsageError
from rig.recording import remote
from rig.recording.remote import Store, address_of
from tests.rig.recording.object_store import BUCKET, served, upload

pytestmark = pytest.mark.xdist_group("object store")


@pytest.fixture(scope="module")
def session(tmp_path_factory: pytest.TempPathFactory) -> Path:
    cycles = Bench(rate_Hz=250.0).cycles(trials=2, speeds_mm_s=(10.0, 20.0))
    return write_made_session(tmp_path_factory.mktemp("made") / "first", cycles)


@pytest.fixture(scope="module")
def address(session: Path) -> Iterator[str]:
    with pytest.MonkeyPatch.context() as patch, served(patch):
        yield upload(session, "first")


def run(*arguments: str | Path) -> Any:
    return CliRunner().invoke(build(str(arguments[0])), [str(part) for part in arguments], catch_exceptions=True)


def test_an_address_is_known_in_the_form_that_a_path_gives_it() -> None:
    assert address_of(Path("s3://lab/first/trial 1.mcap")) == "s3://lab/first/trial 1.mcap"
    assert [address_of(Path(text)) for text in ("sessions/first", "C:/data", "/s3:/x", "s3:")] == [None] * 4


def test_a_copy_holds_the_bytes_of_every_object(address: str, session: Path, tmp_path: Path) -> None:
    found = Store(address).fetch(tmp_path)
    assert found == tmp_path / "first"
    assert {f.name: f.read_bytes() for f in found.iterdir()} == {f.name: f.read_bytes() for f in session.iterdir()}
    one = Store(f"{address}/session.json").fetch(tmp_path / "one")
    assert one.read_bytes() == (session / "session.json").read_bytes()


def test_fit_of_an_address_is_the_fit_of_the_folder(address: str, session: Path, tmp_path: Path) -> None:
    for place, name in ((address, "far"), (session, "near")):
        found = run("fit", place, "--out", tmp_path / name)
        assert found.exit_code == 0, found.output
    far, near = (json.loads((tmp_path / name / "fit.json").read_text()) for name in ("far", "near"))
    assert far["index"] == near["index"]
    assert far["recordings"] == near["recordings"]


def test_verify_diagnose_and_export_read_an_address(address: str, tmp_path: Path) -> None:
    assert run("verify", address, "--json", tmp_path / "verify.json").exit_code in {0, 1}
    assert len(json.loads((tmp_path / "verify.json").read_text())["recordings"]) == 4
    assert run("verify", f"{address}/trial_1000.mcap").exit_code == 0
    run("diagnose", address, "--json", tmp_path / "diagnosis.json")
    assert json.loads((tmp_path / "diagnosis.json").read_text())["verdict"]
    found = run("export", address, "--out", tmp_path / "out", "--format", "csv")
    assert found.exit_code == 0 and list((tmp_path / "out" / "csv").iterdir())


def test_results_are_not_written_into_a_store_nor_beside_it(
    address: str, monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    monkeypatch.chdir(tmp_path)
    found = run("fit", address)
    assert isinstance(found.exception, UsageError)
    assert "never written to: give a place for the results with --out" in str(found.exception)
    assert not list(tmp_path.iterdir())


def refused(ask: Callable[[], object], kind: type[Exception] = DataError) -> str:
    with pytest.raises(kind) as caught:
        ask()
    assert "\n" not in str(caught.value)
    return str(caught.value)


@pytest.mark.usefixtures("address")
def test_what_a_store_refuses_is_one_sentence(monkeypatch: pytest.MonkeyPatch) -> None:
    assert "no such bucket, or nothing in it" in refused(Store("s3://no-such-bucket/first").objects)
    assert "no such bucket, or nothing in it" in refused(Store(f"s3://{BUCKET}/none").objects)
    assert "no store is called nope://" in refused(lambda: Store("nope://x"), UsageError)
    for name in ("AWS_ACCESS_KEY_ID", "AWS_SECRET_ACCESS_KEY"):
        monkeypatch.delenv(name)
    monkeypatch.setenv("AWS_EC2_METADATA_DISABLED", "true")
    monkeypatch.setenv("AWS_SHARED_CREDENTIALS_FILE", os.devnull)
    monkeypatch.setenv("AWS_CONFIG_FILE", os.devnull)
    assert "no credentials; set AWS_ACCESS_KEY_ID" in refused(Store(f"s3://{BUCKET}/first").objects)


@pytest.mark.usefixtures("address")
def test_a_store_that_is_not_there_is_one_sentence(monkeypatch: pytest.MonkeyPatch) -> None:
    with socket.socket() as held:  # bound, and nobody listens
        held.bind(("127.0.0.1", 0))
        monkeypatch.setenv("AWS_ENDPOINT_URL", f"http://127.0.0.1:{held.getsockname()[1]}")
        monkeypatch.setenv("AWS_MAX_ATTEMPTS", "1")
        assert "the store does not answer; check its address" in refused(Store(f"s3://{BUCKET}/first").objects)


def test_an_object_that_is_replaced_while_it_is_read_is_refused(
    address: str, session: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    store, writer = Store(upload(session, "changing")), fsspec.filesystem("s3", skip_instance_cache=True)
    read = store._files.get_file

    def replaced(key: str, target: str) -> None:
        read(key, target)
        if key.endswith("trial_1001.mcap"):
            writer.pipe_file(key, Path(target).read_bytes()[::-1])  # as many bytes, and others

    monkeypatch.setattr(store._files, "get_file", replaced)
    said = refused(lambda: store.fetch(tmp_path))
    assert "trial_1001.mcap was changed while it was read" in said
    assert address


def test_a_library_that_is_missing_is_named_with_the_extra(monkeypatch: pytest.MonkeyPatch) -> None:
    def absent(*_: object, **__: object) -> None:
        raise ImportError("Install s3fs to access S3")

    monkeypatch.setattr(fsspec.core, "url_to_fs", absent)
    assert "pip install 'tissue-rig[s3]'" in refused(lambda: remote.Store("s3://lab/first"), UsageError)
