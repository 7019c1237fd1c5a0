"""Small pieces of HTML. Every text that comes from outside passes through ``text``; pieces are joined, never parsed."""

from collections.abc import Iterable, Mapping, Sequence
from html import escape


def text(value: object) -> str:
    """``value`` as harmless text."""
    return escape(str(value))


def paragraph(value: object, kind: str = "") -> str:
    """A paragraph of plain text."""
    return f"<p{_class(kind)}>{text(value)}</p>"


def section(title: str, *pieces: str) -> str:
    """A titled part of the page."""
    return f"<section><h2>{text(title)}</h2>{''.join(pieces)}</section>"


def cards(values: Iterable[tuple[str, str, str]]) -> str:
    """Key figures: (number, what it is, note)."""
    items = "".join(
        f'<div class="card"><b>{text(number)}</b><span>{text(what)}</span><small>{text(note)}</small></div>'
        for number, what, note in values
    )
    return f'<div class="cards">{items}</div>'


def table(header: Sequence[str], rows: Iterable[Sequence[str]], caption: str = "", words: int = 1) -> str:
    """A table whose first ``words`` columns are text and the others numbers."""
    head = "".join(f"<th{_class(_kind(i, words))}>{text(name)}</th>" for i, name in enumerate(header))
    body = "".join(
        "<tr>" + "".join(f"<td{_class(_kind(i, words))}>{text(cell)}</td>" for i, cell in enumerate(row)) + "</tr>"
        for row in rows
    )
    title = f"<caption>{text(caption)}</caption>" if caption else ""
    return f'<div class="table"><table>{title}<thead><tr>{head}</tr></thead><tbody>{body}</tbody></table></div>'


def pairs(values: Mapping[str, object]) -> str:
    """Names and values."""
    return "<dl>" + "".join(f"<dt>{text(name)}</dt><dd>{text(value)}</dd>" for name, value in values.items()) + "</dl>"


def figure(svg: str, caption: str) -> str:
    """A picture (already markup) and the sentence below it."""
    return f"<figure>{svg}<figcaption>{text(caption)}</figcaption></figure>"


def details(summary: str, *pieces: str) -> str:
    """A part that is folded away on the screen."""
    return f"<details><summary>{text(summary)}</summary>{''.join(pieces)}</details>"


def _kind(column: int, words: int) -> str:
    return "" if column < words else "number"


def _class(kind: str) -> str:
    return f' class="{kind}"' if kind else ""
