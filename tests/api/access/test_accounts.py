"""People with a password: argon2id in a pool of few places, the same time for a name that is not there, few tries."""

import asyncio
import threading
import time
from pathlib import Path

import pytest
from argon2 import PasswordHasher, extract_parameters
from argon2.low_level import Type
from fastapi.testclient import TestClient
from typer.testing import CliRunner

from api.cli.app import build
from api.http.access.access import Access
from api.http.access.accounts import WAITING, AccountStore, Busy
from api.http.access.scopes import Scope
from api.http.access.tokens import TokenStore, access_folder
from api.http.service import Service
from mock_devices.testing.access import ADDRESS, client_of
from mock_devices.testing.clock import Clock
from rig.config.wiring import Wiring
from rig.errors import UsageError

PASSWORD = "soft tissue is not a spring"
QUICK = PasswordHasher(time_cost=1, memory_cost=8, parallelism=1)


@pytest.fixture
def store(tmp_path: Path) -> AccountStore:
    return AccountStore(tmp_path / "access", QUICK)


@pytest.fixture
def clock() -> Clock:
    return Clock()


@pytest.fixture
def service(tmp_path: Path, store: AccountStore, clock: Clock) -> Service:
    found = Service(Wiring(), tmp_path, tmp_path)
    found.access = Access(tmp_path / "access", clock.seconds)
    found.access.accounts = store
    store.set("ann", Scope.OPERATE, PASSWORD)
    return found


def login(client: TestClient, name: str, password: str) -> int:
    sent = {"name": name, "password": password}
    return client.post("/api/v1/auth/login", json=sent, headers={"Origin": ADDRESS}).status_code


def test_a_password_is_kept_as_argon2id_with_at_least_what_the_standard_names(tmp_path: Path) -> None:
    store = AccountStore(tmp_path)
    store.set("ann", Scope.READ, PASSWORD)
    (kept,) = store.accounts()
    cost = extract_parameters(kept.argon2)
    # RFC 9106, section 4: the second recommended option.
    assert (cost.type, cost.memory_cost, cost.time_cost, cost.parallelism) == (Type.ID, 65_536, 3, 4)
    assert PASSWORD not in (tmp_path / "accounts.json").read_text()


def test_the_right_password_enters_and_everything_else_does_not(store: AccountStore) -> None:
    store.set("ann", Scope.OPERATE, PASSWORD)
    found = asyncio.run(store.enter("ann", PASSWORD))
    assert found and (found.name, found.scope, found.by) == ("ann", Scope.OPERATE, "login")
    for name, password in (("ann", PASSWORD + " "), ("ann", ""), ("Ann", PASSWORD), ("ben", PASSWORD), ("ben", "")):
        assert asyncio.run(store.enter(name, password)) is None


def test_a_name_that_is_not_there_costs_a_hash_too(store: AccountStore, monkeypatch: pytest.MonkeyPatch) -> None:
    verified: list[str] = []

    def fits(hashed: str, _: str) -> bool:
        verified.append(hashed)
        return False

    monkeypatch.setattr(store, "_fits", fits)
    asyncio.run(store.enter("nobody", PASSWORD))
    assert verified[0].startswith("$argon2id$")


@pytest.mark.parametrize("password", ["", "short", "x" * 11, "x" * 201])
def test_a_password_has_a_length(store: AccountStore, password: str) -> None:
    with pytest.raises(UsageError, match=f"a password has 12 to 200 letters, and this one {len(password)}"):
        store.set("ann", Scope.READ, password)


def test_hashing_keeps_neither_the_event_loop_nor_more_than_a_few_waiting(
    store: AccountStore, monkeypatch: pytest.MonkeyPatch
) -> None:
    store.set("ann", Scope.READ, PASSWORD)
    free = threading.Event()
    monkeypatch.setattr(store, "_fits", lambda _hashed, _password: free.wait(20))

    async def crowd() -> None:
        tries = [asyncio.create_task(store.enter("ann", PASSWORD)) for _ in range(WAITING)]
        await asyncio.sleep(0)
        began_s = time.monotonic()
        with pytest.raises(Busy):
            await store.enter("ann", PASSWORD)
        assert time.monotonic() - began_s < 5
        free.set()
        assert all(await asyncio.gather(*tries))
        assert await store.enter("ann", PASSWORD)

    asyncio.run(crowd())


def test_a_person_logs_in_and_is_out_when_the_account_is_removed(service: Service) -> None:
    client = client_of(service, scope=None)
    assert login(client, "ann", PASSWORD) == 200
    assert client.get("/api/v1/auth/me").json() == {"name": "ann", "scopes": ["read", "operate"]}
    service.access.accounts.remove("ann")
    assert client.get("/api/v1/auth/me").status_code == 401
    with pytest.raises(UsageError, match="there is no account ann; there are: none"):
        service.access.accounts.remove("ann")


def test_another_password_logs_out_whoever_came_in_by_the_one_before(service: Service) -> None:
    before, after = client_of(service, scope=None), client_of(service, scope=None)
    assert login(before, "ann", PASSWORD) == 200
    service.access.accounts.set("ben", Scope.OPERATE, PASSWORD)
    assert before.get("/api/v1/auth/me").status_code == 200
    service.access.accounts.set("ann", Scope.OPERATE, PASSWORD + "!")
    assert login(after, "ann", PASSWORD + "!") == 200
    assert [client.get("/api/v1/auth/me").status_code for client in (before, after)] == [401, 200]


def test_wrong_passwords_are_few_and_then_slow(service: Service, clock: Clock) -> None:
    client = client_of(service, scope=None)
    assert [login(client, "ann", "wrong password") for _ in range(6)] == [401] * 5 + [429]
    refused = client.post("/api/v1/auth/login", json={"name": "ann", "password": PASSWORD})
    assert (refused.status_code, refused.json()["code"]) == (429, "too-many")
    assert 1 <= int(refused.headers["retry-after"]) <= 24
    clock.advance(24.1)
    assert login(client, "ann", PASSWORD) == 200


def test_a_pool_that_is_full_asks_to_come_again(service: Service, monkeypatch: pytest.MonkeyPatch) -> None:
    async def busy(_name: str, _password: str) -> None:
        raise Busy

    monkeypatch.setattr(service.access.accounts, "enter", busy)
    assert login(client_of(service, scope=None), "ann", PASSWORD) == 429


def test_accounts_are_made_listed_and_removed_on_the_command_line(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("XDG_STATE_HOME", str(tmp_path))

    def account(*arguments: str, typed: str = "") -> str:
        answer = CliRunner().invoke(build("account"), ["account", *arguments], input=typed)
        return answer.output if answer.exit_code == 0 else str(answer.exception)

    assert "ben (read) logs in" in account("set", "ben", "--scope", "read", typed=PASSWORD + "\n")
    assert asyncio.run(AccountStore(access_folder()).enter("ben", PASSWORD))
    assert "ben" in account("list")
    assert "a password has 12 to 200 letters" in account("set", "ben", typed="no\n")
    assert "whose account?" in account("set")
    assert "the account ben is removed" in account("remove", "ben")


def test_accounts_are_listed_for_administrators_without_what_a_password_is_kept_as(
    service: Service, tmp_path: Path
) -> None:
    secret = TokenStore(tmp_path / "access").create("program", Scope.ADMIN).secret
    client = client_of(service, scope=None)
    listed = client.get("/api/v1/accounts", headers={"Authorization": f"Bearer {secret}"})
    assert listed.json() == {"items": [{"name": "ann", "scope": "operate"}], "next": None}
