"""Tokens: shown once, kept as SHA-256, good until they are revoked; in a file that others cannot read."""

import hashlib
import json
import os
from pathlib import Path

import pytest

from api.http.access.scopes import Scope
from api.http.access.secrets import digest, new_secret, position
from api.http.access.tokens import TokenStore
from rig.errors import UsageError


@pytest.fixture
def store(tmp_path: Path) -> TokenStore:
    return TokenStore(tmp_path / "access")


def file_of(store: TokenStore) -> Path:
    return store._file.path


def test_a_token_has_256_random_bits_and_is_kept_as_its_sha_256_alone(store: TokenStore) -> None:
    made = store.create("notebook", Scope.OPERATE)
    assert made.secret.startswith("rig_")
    assert len(made.secret.removeprefix("rig_")) == 43  # ceil(256 / 6) letters of base 64
    text = file_of(store).read_text()
    assert made.secret not in text
    assert json.loads(text)["tokens"][0]["sha256"] == hashlib.sha256(made.secret.encode()).hexdigest()


def test_a_digest_is_that_of_the_standard() -> None:
    # FIPS 180-4, the example of one block.
    assert digest("abc") == "ba7816bf8f01cfea414140de5dae2223b00361a396177a9cb410ff61f20015ad"


def test_secrets_differ() -> None:
    assert len({new_secret() for _ in range(100)}) == 100


def test_its_holder_is_known_by_it_and_nobody_by_anything_else(store: TokenStore) -> None:
    made, other = store.create("a", Scope.READ), store.create("b", Scope.ADMIN)
    found = store.caller(made.secret)
    assert found and (found.name, found.scope, found.id) == ("a", Scope.READ, made.token.id)
    assert store.caller(made.token.sha256) is None
    for wrong in ("", "rig_", made.secret[:-1], made.secret + "x", made.secret.upper(), "\udce9", "ä" * 40):
        assert store.caller(wrong) is None, wrong
    admin = store.caller(other.secret)
    assert admin and admin.may(Scope.OPERATE) and not found.may(Scope.OPERATE)


def test_every_kept_digest_is_compared_to_its_end(monkeypatch: pytest.MonkeyPatch) -> None:
    compared: list[tuple[str, str]] = []

    def compare(one: str, other: str) -> bool:
        compared.append((one, other))
        return one == other

    monkeypatch.setattr("hmac.compare_digest", compare)
    kept = [digest(name) for name in ("a", "b", "c")]
    assert position("a", kept) == 0
    assert compared == [(kept[0], other) for other in kept]


def test_what_another_process_makes_or_revokes_counts_at_once(store: TokenStore) -> None:
    elsewhere = TokenStore(file_of(store).parent)
    made = elsewhere.create("a", Scope.READ)
    assert store.caller(made.secret)
    elsewhere.revoke("a")
    assert store.caller(made.secret) is None


def test_a_token_is_revoked_by_name_or_id_and_one_that_is_not_there_is_named(store: TokenStore) -> None:
    made = store.create("a", Scope.READ)
    store.create("b", Scope.READ)
    assert store.revoke(made.token.id).name == "a"
    with pytest.raises(UsageError, match="there is no token called a; there are: b"):
        store.revoke("a")


def test_a_name_names_one_token(store: TokenStore) -> None:
    store.create("a", Scope.READ)
    with pytest.raises(UsageError, match="there is a token called a; revoke it first"):
        store.create("a", Scope.ADMIN)


def test_the_files_are_the_owners_alone_and_others_are_not_believed(store: TokenStore) -> None:
    made = store.create("a", Scope.ADMIN)
    path = file_of(store)
    assert [oct(found.stat().st_mode & 0o777) for found in (path.parent, path)] == ["0o700", "0o600"]
    path.chmod(0o640)
    os.utime(path, ns=(1, 1))
    with pytest.raises(UsageError, match=f"{path}: others may read or change it; `chmod 600"):
        store.caller(made.secret)


@pytest.mark.parametrize("text", ["", "{", "[]", '{"tokens": [{"name": "a"}]}', '{"version": 1, "tokens": [], "x": 1}'])
def test_a_file_that_is_not_what_was_written_lets_nobody_in(store: TokenStore, text: str) -> None:
    made = store.create("a", Scope.ADMIN)
    file_of(store).write_text(text)
    with pytest.raises(UsageError, match=r"tokens\.json: cannot be read"):
        store.caller(made.secret)


def test_a_write_that_fails_leaves_what_was_there(store: TokenStore, monkeypatch: pytest.MonkeyPatch) -> None:
    made = store.create("a", Scope.READ)

    def full(_: int) -> None:
        raise OSError(28, "No space left on device")

    monkeypatch.setattr(os, "fsync", full)
    with pytest.raises(OSError, match="No space left"):
        store.create("b", Scope.READ)
    assert store.caller(made.secret)
    assert [token.name for token in TokenStore(file_of(store).parent).tokens()] == ["a"]
