"""``python -m tools.page_check``: the page's TypeScript against the interface that the service itself describes.

Types are made from the OpenAPI document of the routes as they are now, so that a route or field that the page uses and
that is gone, or has another type, is an error here.
"""

import json
import sys
import tempfile
from pathlib import Path

from api.http.app import build
from api.http.service import Service
from hatch_build import LIMIT_S, SOURCES, NodeFailed, fetch, node
from rig.config.wiring import Wiring

MODULES = "node_modules"


def interface() -> str:
    """The OpenAPI document, as JSON."""
    return json.dumps(build(Service(Wiring(), Path("sessions"), Path("protocols"))).openapi())


def check(described: str, sources: Path = SOURCES) -> str:
    """What is wrong with the page in ``sources`` over the interface ``described``; empty where nothing is."""
    fetch(sources, LIMIT_S)
    with tempfile.NamedTemporaryFile("w", suffix=".json") as file:
        file.write(described)
        file.flush()
        generator = f"{MODULES}/openapi-typescript/bin/cli.js"
        node([generator, file.name, "--output", "src/openapi.d.ts"], sources, LIMIT_S)
    try:
        node([f"{MODULES}/typescript/bin/tsc", "--noEmit"], sources, LIMIT_S)
    except NodeFailed as error:
        return str(error)
    return ""


def main() -> None:
    """Ends with what is wrong."""
    if wrong := check(interface()):
        sys.exit(wrong)
    sys.stdout.write("the page agrees with the interface\n")


if __name__ == "__main__":
    main()
