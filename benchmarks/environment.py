"""How large the program is without development tools: `python -m benchmarks.environment`; the last line is JSON.

The wheel is built and installed with what it needs, as locked, into an empty folder. A package's size is that of its
files. The whole is what it takes of a disk, as `du -sm` counts: 674 at commit 2887b84, which set the goal of 700.
"""

import json
import re
import subprocess
import sys
import tempfile
from collections import Counter
from pathlib import Path

ROOT = Path(__file__).parents[1]
UV = str(Path(sys.executable).parent / "uv")
SHOWN = 15
# numpy.libs and scipy.libs belong to their packages.
LIBS = ".libs"
PINNED = re.compile(r"^[\w.-]+(?:\[[\w,]+\])?==[^\s\\]+(?: ; [^\\\n]+)?", re.MULTILINE)


def installed(folder: Path) -> None:
    """The wheel and its dependencies at the versions of the lock."""
    wheels, pinned = folder / "wheel", folder / "constraints.txt"
    build = [UV, "build", "--quiet", "--wheel", "--python", sys.executable, "--no-build-isolation"]
    subprocess.run([*build, "--out-dir", str(wheels)], cwd=ROOT, check=True)
    (wheel,) = wheels.glob("*.whl")
    pinned.write_text("\n".join(PINNED.findall((ROOT / "requirements.lock").read_text())) + "\n")
    install = [UV, "pip", "install", "--quiet", "--target", str(folder / "site"), "--python", sys.executable]
    subprocess.run([*install, "--constraints", str(pinned), str(wheel)], check=True)


def sizes_MB(site: Path) -> dict[str, float]:
    """Size of each package's folder, the largest first."""
    found: Counter[str] = Counter()
    for file in (path for path in site.rglob("*") if path.is_file() and not path.is_symlink()):
        found[file.relative_to(site).parts[0].removesuffix(LIBS)] += file.stat().st_size
    return {name: size / 1e6 for name, size in found.most_common()}


def on_disk_MiB(site: Path) -> float:
    """What the folder takes of its disk: blocks of 512 bytes of all that is in it, and its own."""
    return sum(path.lstat().st_blocks for path in (site, *site.rglob("*"))) * 512 / 2**20


def main() -> None:
    """Measures and prints."""
    with tempfile.TemporaryDirectory() as name:
        installed(Path(name))
        sizes, whole_MiB = sizes_MB(Path(name) / "site"), round(on_disk_MiB(Path(name) / "site"), 1)
    largest = {package: round(size_MB, 1) for package, size_MB in list(sizes.items())[:SHOWN]}
    for package, size_MB in largest.items():
        print(f"{package:24}{size_MB:8.1f} MB")
    whole_MB = round(sum(sizes.values()), 1)
    print(f"{'whole':24}{whole_MB:8.1f} MB; {whole_MiB} MiB of the disk, as `du -sm` counts")
    print(json.dumps({"whole_MB": whole_MB, "whole_MiB": whole_MiB, "largest": largest}))


if __name__ == "__main__":
    main()
