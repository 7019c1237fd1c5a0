"""Where the service may listen: on this computer alone, or where nobody reads along; else one sentence."""

import socket
import ssl
from pathlib import Path

import pytest
from cryptography.hazmat.primitives.serialization import (
    BestAvailableEncryption,
    Encoding,
    PrivateFormat,
    load_pem_private_key,
)
from typer.testing import CliRunner

from api.cli.app import build
from api.http.access.served_at import ServedAt, ServeOptions, served_at
from rig.errors import UsageError
from tests.api.access.tls import Files, made


@pytest.fixture(scope="module")
def files(tmp_path_factory: pytest.TempPathFactory) -> Files:
    return made(tmp_path_factory.mktemp("tls"), "bench.example.org")


def asked(
    host: str = "127.0.0.1", names: tuple[str, ...] = (), tls: Files | None = None, proxy: str = "", port: int = 8000
) -> ServeOptions:
    return ServeOptions(host, port, names, tls and tls.certificate, tls and tls.key, proxy)


def test_it_is_this_computer_alone_where_nothing_is_asked_for() -> None:
    found = served_at(asked())
    assert (found.here, found.address, found.names, found.tls) == (
        "http://127.0.0.1:8000", "http://127.0.0.1:8000", (), None
    )  # fmt: skip
    assert served_at(asked("::1")).here == "http://[::1]:8000"
    assert served_at(asked("localhost")).here == "http://localhost:8000"


@pytest.mark.parametrize("host", ["0.0.0.0", "::", "192.0.2.7", "bench.example.org", "127.0.0.2"])
def test_beyond_this_computer_it_needs_tls(host: str) -> None:
    with pytest.raises(
        UsageError, match=r"others on the network would read .* --tls-cert and --tls-key, or stay on 127"
    ):
        served_at(asked(host))


@pytest.mark.parametrize(
    ("host", "names", "address", "here", "reached"),
    [
        ("0.0.0.0", ("Bench.Example.org", "b"), "https://bench.example.org:8443", "https://127.0.0.1:8443",
         ("bench.example.org", "b")),
        ("0.0.0.0", (), f"https://{socket.gethostname().lower()}:8443", "https://127.0.0.1:8443",
         (socket.gethostname().lower(),)),
        ("192.0.2.7", (), "https://192.0.2.7:8443", "https://192.0.2.7:8443", ()),
        ("2001:db8::7", (), "https://[2001:db8::7]:8443", "https://[2001:db8::7]:8443", ()),
        ("bench.example.org", (), "https://bench.example.org:8443", "https://bench.example.org:8443",
         ("bench.example.org",)),
        ("127.0.0.1", (), "https://127.0.0.1:8443", "https://127.0.0.1:8443", ()),
    ],
)  # fmt: skip
def test_with_a_certificate_it_listens_where_it_is_told(
    files: Files, host: str, names: tuple[str, ...], address: str, here: str, reached: tuple[str, ...]
) -> None:
    found = served_at(asked(host, names, files, port=8443))
    assert (found.address, found.here, found.names) == (address, here, reached)
    assert found.tls and found.tls.minimum_version >= ssl.TLSVersion.TLSv1_2


@pytest.mark.parametrize(
    ("proxy", "address"),
    [
        ("https://bench.example.org", "https://bench.example.org"),
        ("https://Bench.example.org/", "https://bench.example.org"),
        ("https://bench.example.org:443", "https://bench.example.org"),
        ("https://bench.example.org:8443", "https://bench.example.org:8443"),
    ],
)
def test_behind_a_proxy_it_stays_on_this_computer_and_knows_what_people_open(proxy: str, address: str) -> None:
    found = served_at(asked(proxy=proxy, names=("other",)))
    assert found == ServedAt("127.0.0.1", 8000, ("bench.example.org", "other"), None, address, None, 8002)
    assert (found.address, found.here) == (address, "http://127.0.0.1:8000")


@pytest.mark.parametrize(
    "proxy",
    ["bench.example.org", "http://bench.example.org", "https://", "https://a/rig", "https://a b", "https://ann@a",
     "https://a:99999", "https://a:x", "https://[", "https://a?x", "https://-a"],
)  # fmt: skip
def test_what_is_no_address_that_people_open_is_refused(proxy: str) -> None:
    with pytest.raises(UsageError, match=r"write what people open, as https://bench\.example\.org"):
        served_at(asked(proxy=proxy))


def test_a_proxy_has_the_certificate_and_is_on_this_computer(files: Files) -> None:
    for wrong in (asked("0.0.0.0", proxy="https://a"), asked(tls=files, proxy="https://a")):
        with pytest.raises(UsageError, match="leave out --host, --tls-cert and --tls-key"):
            served_at(wrong)


@pytest.mark.parametrize("name", ["https://a", "a:80", "", "a b", "-a", "a.", "ä.example", "a" * 64, "*.example.org"])
def test_what_is_no_name_of_a_host_is_refused(name: str) -> None:
    with pytest.raises(UsageError, match=r"is no host name; write it as in bench\.example\.org"):
        served_at(asked(names=(name,)))


def test_certificate_and_key_are_given_together(files: Files) -> None:
    with pytest.raises(UsageError, match="--tls-cert: needs --tls-key too"):
        served_at(ServeOptions("0.0.0.0", 1, (), files.certificate, None, ""))
    with pytest.raises(UsageError, match="--tls-key: needs --tls-cert too"):
        served_at(ServeOptions("0.0.0.0", 1, (), None, files.key, ""))


def private(path: Path, content: bytes) -> Path:
    path.touch(mode=0o600)
    path.write_bytes(content)
    return path


def test_files_that_are_not_what_they_should_be_are_named(files: Files, tmp_path: Path) -> None:
    other = made(tmp_path, "other.example.org")
    noise = private(tmp_path / "noise.pem", b"\x00noise")
    key = load_pem_private_key(files.key.read_bytes(), None)
    password = BestAvailableEncryption(b"secret")
    locked = private(tmp_path / "locked", key.private_bytes(Encoding.PEM, PrivateFormat.PKCS8, password))
    absent = tmp_path / "absent"
    for certificate, given, sentence in (
        (absent, files.key, f"--tls-cert {absent}: cannot be read: No such file or directory; correct path or rights"),
        (files.certificate, tmp_path, f"--tls-key {tmp_path}: cannot be read: Is a directory"),
        (noise, files.key, "not both are PEM"),
        (files.certificate, noise, "not both are PEM"),
        (files.certificate, other.key, f"--tls-key {other.key}: that is the key of another certificate"),
        (files.certificate, locked, "is locked by a password, which nobody types at a service"),
    ):
        with pytest.raises(UsageError) as refused:
            served_at(ServeOptions("0.0.0.0", 1, (), certificate, given, ""))
        assert sentence in str(refused.value)


def test_a_key_that_everybody_may_read_is_refused(files: Files, tmp_path: Path) -> None:
    open_key = private(tmp_path / "key.pem", files.key.read_bytes())
    open_key.chmod(0o604)
    with pytest.raises(UsageError, match="everybody on this computer may read it; `chmod o= "):
        served_at(ServeOptions("0.0.0.0", 1, (), files.certificate, open_key, ""))
    open_key.chmod(0o640)  # as Debian's group ssl-cert has it
    assert served_at(ServeOptions("0.0.0.0", 1, (), files.certificate, open_key, "")).tls


@pytest.mark.parametrize("host", ["192.0.2.7", "no-such-host.invalid"])
def test_an_address_of_another_computer_is_said_to_be_one(
    files: Files, host: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    given = ["--tls-cert", str(files.certificate), "--tls-key", str(files.key)]
    answer = CliRunner().invoke(build("serve"), ["serve", "--host", host, *given])
    assert str(answer.exception) == f"--host {host}: is no address of this computer; `ip address` lists them"
    assert list(tmp_path.iterdir()) == []
