"""The page is built once for its sources, given up with a sentence, and agrees with what the service describes."""

import json
import shutil
import socket
import time
from pathlib import Path
from typing import Any

import pytest

import hatch_build
from hatch_build import SOURCES, PageNotBuilt, build, is_current, npm_environment, stamp
from tools import page_check


@pytest.fixture
def sources(tmp_path: Path) -> Path:
    """A copy without what was fetched."""
    copy = tmp_path / "page" / "sources"
    shutil.copytree(SOURCES, copy, ignore=shutil.ignore_patterns("node_modules"))
    return copy


def test_what_is_current_is_not_built_again_and_any_change_makes_it_old(sources: Path) -> None:
    stamp(sources).parent.mkdir()
    stamp(sources).write_text(hatch_build.digest(sources) + "\n")
    assert build(sources) is False
    for file, text in (("src/texts/en.ts", "// more"), ("src/new.ts", ""), ("package-lock.json", "{}")):
        (sources / file).write_text(text)
        assert not is_current(sources)
        stamp(sources).write_text(hatch_build.digest(sources))
    (sources / "src" / "new.ts").rename(sources / "src" / "other.ts")
    assert not is_current(sources)
    (sources / "src" / "openapi.d.ts").write_text("generated")
    stamp(sources).write_text(hatch_build.digest(sources))
    (sources / "src" / "openapi.d.ts").unlink()
    assert is_current(sources)


def test_a_registry_that_does_not_answer_is_given_up_with_a_sentence_and_leaves_what_was_built(
    sources: Path, monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    stamp(sources).parent.mkdir()
    stamp(sources).write_text("of other sources")
    with socket.create_server(("127.0.0.1", 0)) as silent:
        monkeypatch.setenv("npm_config_registry", f"http://127.0.0.1:{silent.getsockname()[1]}/")
        monkeypatch.setenv("npm_config_cache", str(tmp_path / "cache"))
        began = time.monotonic()
        with pytest.raises(PageNotBuilt, match=r"the page is not built: .*run `make page`: npm-cli.js ci took more"):
            build(sources, limit_s=3.0)
    assert time.monotonic() - began < 30
    assert stamp(sources).read_text() == "of other sources"


def test_npm_trusts_what_everything_else_here_trusts() -> None:
    given = npm_environment({"SSL_CERT_FILE": "/etc/ours.pem", "PATH": "/bin"}, Path("/node/bin"))
    assert given["NODE_EXTRA_CA_CERTS"] == "/etc/ours.pem"
    assert given["PATH"] == "/node/bin:/bin"
    own = npm_environment({"SSL_CERT_FILE": "/etc/ours.pem", "NODE_EXTRA_CA_CERTS": "/own.pem"}, Path("/node/bin"))
    assert own["NODE_EXTRA_CA_CERTS"] == "/own.pem"
    assert "NODE_EXTRA_CA_CERTS" not in npm_environment({}, Path("/node/bin"))


@pytest.fixture(scope="module")
def described() -> dict[str, Any]:
    found: dict[str, Any] = json.loads(page_check.interface())
    return found


def test_the_page_agrees_with_the_interface_and_a_route_or_field_that_is_gone_is_named(
    described: dict[str, Any],
) -> None:
    assert page_check.check(json.dumps(described)) == ""
    del described["paths"]["/api/v1/protocols"]
    fields = described["components"]["schemas"]["RigView"]["properties"]
    fields["doing"] = fields.pop("mode")
    wrong = page_check.check(json.dumps(described))
    assert "/api/v1/protocols" in wrong and "'mode' does not exist" in wrong
