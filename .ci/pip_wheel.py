"""Prints how to run pip: as a module where this Python has it, else as a wheel fetched from the package index.

``python3 .ci/pip_wheel.py FOLDER`` is for a Python without pip and without ensurepip, as a plain Debian has it: pip's
wheel runs as it is. PIP_INDEX_URL is heeded, and the index's own SHA-256 is checked.
"""

import hashlib
import importlib.util
import os
import re
import sys
import urllib.parse
import urllib.request
from pathlib import Path

INDEX = "https://pypi.org/simple"
WHEEL = re.compile(r'href="([^"]*/(pip-([0-9.]+)-py3-none-any\.whl)#sha256=([0-9a-f]{64}))"')


def fetched(folder: Path) -> Path:
    """The newest pip of the index in ``folder``, ready to run."""
    page = os.environ.get("PIP_INDEX_URL", INDEX).rstrip("/") + "/pip/"
    with urllib.request.urlopen(page) as answer:
        found = WHEEL.findall(answer.read().decode())
    link, name, _, digest = max(found, key=lambda wheel: [int(part) for part in wheel[2].split(".")])
    with urllib.request.urlopen(urllib.parse.urljoin(page, link)) as answer:
        data = answer.read()
    if hashlib.sha256(data).hexdigest() != digest:
        sys.exit(f"{name} from {page}: its SHA-256 is not the one the index states; try again")
    (folder / name).write_bytes(data)
    return folder / name / "pip"


if __name__ == "__main__":
    sys.stdout.write("-m pip" if importlib.util.find_spec("pip") else str(fetched(Path(sys.argv[1]))))
