"""The command line beside a service: through a socket that its own account alone can open, or with a token."""

import http.client
import os
import socket
import stat
import tempfile
from collections.abc import Iterator
from pathlib import Path

import pytest

from api.cli.serve import own_socket
from api.http.access.scopes import Scope
from api.http.access.served_at import ServedAt
from api.http.service import Service
from api.operations.remote import OwnSocket, RemoteBench, socket_path
from mock_devices.testing.access import token
from rig.config.wiring import Wiring
from rig.errors import DeviceError
from tests.api.access.tls import serving


@pytest.fixture
def address(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[str]:
    monkeypatch.delenv("TISSUE_RIG_TOKEN", raising=False)
    with serving(Service(Wiring(), tmp_path, tmp_path), ServedAt("127.0.0.1", 0)) as place:
        yield place.here


def test_the_socket_asks_for_no_token_and_allows_all(address: str) -> None:
    assert RemoteBench(address).state().state == "disconnected"
    assert RemoteBench(address).link("Ann", "read").startswith(f"{address}/#ticket=")


def test_its_account_alone_may_open_the_socket_and_it_goes_with_the_service(tmp_path: Path) -> None:
    path = tmp_path / "service-1.sock"
    with own_socket(path):
        assert stat.S_ISSOCK(path.stat().st_mode)
        assert oct(path.stat().st_mode & 0o777) == "0o600"
    assert not path.exists()


def test_a_socket_that_a_killed_service_left_is_replaced_and_a_folder_may_be_deep(tmp_path: Path) -> None:
    folder = tmp_path / ("deep" * 30)
    folder.mkdir()
    left = folder / "service-1.sock"
    left.touch()
    with own_socket(left) as own:
        client = OwnSocket(left)
        client.connect()
        accepted, _ = own.accept()
        accepted.close()
        client.close()


def test_where_the_socket_is_not_the_token_of_the_environment_is_sent(
    address: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    socket_path(address).unlink()
    with pytest.raises(DeviceError, match=r"refuses: nobody is logged in here: log in on the page, or send"):
        RemoteBench(address).state()
    monkeypatch.setenv("TISSUE_RIG_TOKEN", token(Scope.READ))
    assert RemoteBench(address).state().state == "disconnected"
    with pytest.raises(DeviceError, match="this asks for the scope operate"), RemoteBench(address):
        pass


def test_what_comes_through_the_socket_may_carry_a_token_of_less(address: str) -> None:
    client = OwnSocket(socket_path(address))
    client.request("POST", "/api/v1/auth/links", "{}", {"Authorization": f"Bearer {token(Scope.READ)}"})
    assert client.getresponse().status == 403
    client.close()


def test_over_tcp_nothing_passes_for_the_socket(address: str) -> None:
    host, port = address.removeprefix("http://").split(":")
    client = http.client.HTTPConnection(host, int(port))
    client.request("GET", "/api/v1/rig", headers={"Host": "localhost"})
    assert client.getresponse().status == 401
    client.close()


def test_another_account_cannot_open_it() -> None:
    if os.getuid() != 0:
        pytest.skip("only root can try as somebody else")
    with tempfile.TemporaryDirectory() as folder, socket.socket(socket.AF_UNIX) as client:
        path = Path(folder) / "service-1.sock"
        path.parent.chmod(0o755)
        with own_socket(path):
            os.seteuid(65_534)
            try:
                refused = client.connect_ex(str(path))
            finally:
                os.seteuid(0)
            assert os.strerror(refused) == "Permission denied"
            assert client.connect_ex(str(path)) == 0
