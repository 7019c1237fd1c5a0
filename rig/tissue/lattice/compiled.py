"""Where compiled kernels are kept between processes.

numba renews a kernel only when the file that defines it changes, not when a file it calls into does. The folder is
therefore named after the contents of all kernel files, and stale machine code can never be loaded.
"""

import hashlib
import tempfile
from pathlib import Path

from numba import config

from rig.machine_code import code_folder

_SOURCES = ("numba_types.py", "rows.py", "cells.py", "kernels.py", "steps.py")


def kernel_folder() -> Path:
    """Folder for the present sources."""
    digest = hashlib.sha256(b"".join((Path(__file__).parent / name).read_bytes() for name in _SOURCES)).hexdigest()[:16]
    return code_folder() / f"kernels-{digest}"


def keep_compiled_kernels() -> None:
    """Point numba at `kernel_folder`, or at a temporary folder where that cannot be written."""
    folder = kernel_folder()
    try:
        folder.mkdir(parents=True, exist_ok=True)
        (folder / "in-use").touch()
    except OSError:
        folder = Path(tempfile.mkdtemp(prefix="tissue-rig-kernels-"))
    config.CACHE_DIR = str(folder)  # type: ignore[attr-defined]  # numba fills this module when it is imported
