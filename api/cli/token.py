"""`rig token`: who may use the service, besides whoever runs it."""

from collections.abc import Sequence
from typing import Annotated, Literal

import typer

from api.cli.output import show
from api.http.access.scopes import WORDS, ScopeWord
from api.http.access.tokens import Token, TokenStore, access_folder
from api.operations.remote import RemoteBench
from rig.errors import UsageError
from rig.results.tables import TextTable

LONGEST_NAME = 80


def token(
    action: Annotated[Literal["create", "list", "revoke", "link"], typer.Argument(help="What to do.")],
    name: Annotated[str, typer.Argument(help="Name of the token; for a link, of whom it logs in.")] = "",
    scope: Annotated[ScopeWord, typer.Option(help="What it allows; each scope includes the one before.")] = "operate",
    port: Annotated[int, typer.Option(min=1, max=65535, help="For a link: where the service listens.")] = 8000,
) -> None:
    """Makes, lists and revokes tokens for programs that use the service; `link` prints an address that logs in once.

    read sees the bench and its sessions, operate also moves it and sees names, admin also makes tokens and erases. A
    token is shown once and good until it is revoked.

    Example: rig token create notebook --scope operate
    """
    if action == "list":
        show(_table(TokenStore(access_folder()).tokens()))
    elif not 0 < len(name) <= LONGEST_NAME:
        raise UsageError(f"a name of 1 to {LONGEST_NAME} letters is needed, as in: rig token {action} notebook")
    elif action == "create":
        made = TokenStore(access_folder()).create(name, WORDS[scope])
        show(made.secret)
        typer.echo(f"token {name} ({scope}): shown only now; send it as `Authorization: Bearer ...`", err=True)
    elif action == "revoke":
        ended = TokenStore(access_folder()).revoke(name)
        show(f"token {ended.name} ({ended.scope}) is revoked")
    else:
        show(RemoteBench(f"http://127.0.0.1:{port}").link(name, scope))


def _table(tokens: Sequence[Token]) -> TextTable:
    rows = [(token.name, token.scope, token.created, token.id) for token in tokens]
    return TextTable("Tokens", ("name", "scope", "made", "id"), rows, words=4)
