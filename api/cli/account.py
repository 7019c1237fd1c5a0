"""`rig account`: people who log in on the page with a password."""

import sys
from typing import Annotated, Literal

import typer

from api.cli.output import show
from api.http.access.accounts import AccountStore
from api.http.access.scopes import WORDS, ScopeWord
from api.http.access.tokens import access_folder
from rig.errors import UsageError
from rig.results.tables import TextTable


def account(
    action: Annotated[Literal["set", "list", "remove"], typer.Argument(help="What to do.")],
    name: Annotated[str, typer.Argument(help="Who it is, as others are told.")] = "",
    scope: Annotated[ScopeWord, typer.Option(help="What it allows; each scope includes the one before.")] = "operate",
) -> None:
    """Makes, lists and removes accounts of people who log in on the page; asks for the password, or reads it.

    Example: rig account set ann --scope operate < password.txt
    """
    store = AccountStore(access_folder())
    if action == "list":
        show(TextTable("Accounts", ("name", "scope"), [(one.name, one.scope) for one in store.accounts()], words=2))
    elif not name:
        raise UsageError(f"whose account? For example: rig account {action} ann")
    elif action == "set":
        store.set(name, WORDS[scope], _password())
        show(f"{name} ({scope}) logs in on the page with that password")
    else:
        store.remove(name)
        show(f"the account {name} is removed, and whoever is logged in with it is out")


def _password() -> str:
    if sys.stdin.isatty():
        return str(typer.prompt("Password", hide_input=True, confirmation_prompt=True))
    return sys.stdin.readline().rstrip("\n")
