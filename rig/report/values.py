"""Values out of JSON that somebody else wrote: what is not as expected is absent, never an exception."""

import json
from collections.abc import Mapping


def json_table(text: str) -> Mapping[str, object]:
    """The JSON object in ``text``; other text is the value of an empty name."""
    try:
        value = json.loads(text)
    except ValueError:
        return {"": text}
    return value if isinstance(value, dict) else {"": value}


def of_many(noun: str, count: int) -> str:
    """The noun for that many: ``recording`` of one, ``recordings`` of two."""
    return noun if count == 1 else f"{noun}s"
