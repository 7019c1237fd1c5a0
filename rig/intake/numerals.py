"""Why a cell of a text is not the number that the form of its table says, and which key of a mapping says otherwise."""

import re

from rig.errors import DataError
from rig.intake.cells import affixed
from rig.intake.mapping import FileForm
from rig.intake.notation import GROUPS, hyphened


def check_number(place: str, text: str, form: FileForm) -> None:
    """Raises DataError naming ``place`` where ``text`` is neither a number of this form nor stands for none."""
    if text in form.missing:
        return
    if form.thousands and form.thousands in text and not re.fullmatch(GROUPS.format(re.escape(form.thousands)), text):
        raise DataError(f"{place}: {text!r} is no number whose thousands {form.thousands!r} parts; correct the mapping")
    try:
        float(text.replace(form.thousands, "").replace(form.decimal, ".") if form.thousands else _pointed(text, form))
    except ValueError as error:
        raise DataError(f"{place}: {text!r} is not a number{_hint(text, form)}") from error


def _pointed(text: str, form: FileForm) -> str:
    if "_" in text or (form.decimal == "," and "." in text):
        raise ValueError(text)
    return text.replace(form.decimal, ".")


def _hint(text: str, form: FileForm) -> str:
    if hyphened(text) != text:
        return "; if its sign is a minus, state it: minus = '\u2212'"
    digits = text.lstrip("+-")
    if digits.replace(",", "").replace(".", "").isdigit() and digits.count(",") + digits.count(".") > 1:
        return "; if digits are parted in thousands, state it: thousands = ',' (or '.', with decimal = ',')"
    if form.decimal == "." and digits.replace(",", "", 1).isdigit():
        return "; if this is a decimal comma, state it: decimal = ','"
    if form.decimal == "," and digits.replace(".", "", 1).isdigit():
        return ", for others of this table have a decimal comma; write one of the two in all of them"
    if affixed(text).number != text and form.affixes:
        return " with the name and unit of the first row's; one column has one unit: mend it, or take the row out"
    if affixed(text).number != text:
        return "; if every cell of the column has this name or unit beside its number, state it: affixes = true"
    return f"; if it says that there is no value, add it: missing = ['', {text!r}]"
