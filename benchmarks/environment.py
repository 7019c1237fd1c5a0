"""How large the program is without development tools: `python -m benchmarks.environment`; the last line is JSON.

The wheel is built and installed with what it needs, as locked, into an empty folder; the sizes are those of the files.
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


def installed(folder: Path) -> None:
    """The wheel and its dependencies at the versions of the lock."""
    wheels = folder / "wheel"
    build = [
        UV,
        "build",
        "--quiet",
        "--wheel",
        "--python",
        sys.executable,
        "--no-build-isolation",
        "--out-dir",
        str(wheels),
    ]
    subprocess.run(build, cwd=ROOT, check=True)
    (wheel,) = wheels.glob("*.whl")
    # Hashes are left out: a constraint says the version only.
    versions = re.findall(
        r"^[\w.-]+(?:\[[\w,]+\])?==[^\s\\]+(?: ; [^\\\n]+)?", (ROOT / "requirements.lock").read_text(), re.M
    )
    (folder / "constraints.txt").write_text("\n".join(versions) + "\n")
    install = [UV, "pip", "install", "--quiet", "--target", str(folder / "site"), "--python", sys.executable]
    subprocess.run([*install, "--constraints", str(folder / "constraints.txt"), str(wheel)], check=True)


def sizes_MB(site: Path) -> Counter[str]:
    """Size of each package's folder."""
    found: Counter[str] = Counter()
    for file in (path for path in site.rglob("*") if path.is_file() and not path.is_symlink()):
        found[file.relative_to(site).parts[0].removesuffix(LIBS)] += file.stat().st_size
    return Counter({name: round(size / 1e6, 1) for name, size in found.items()})  # type: ignore[misc]


def main() -> None:
    """Measures and prints."""
    with tempfile.TemporaryDirectory() as name:
        installed(Path(name))
        sizes = sizes_MB(Path(name) / "site")
    for package, size_MB in sizes.most_common(SHOWN):
        print(f"{package:24}{size_MB:8.1f} MB")
    whole_MB = round(sum(sizes.values()), 1)
    print(f"{'whole':24}{whole_MB:8.1f} MB")
    print(json.dumps({"whole_MB": whole_MB, "largest": dict(sizes.most_common(SHOWN))}))


if __name__ == "__main__":
    main()
