"""Which tests belong to a change, and that time runs out without a failure or a silence."""

import subprocess
from pathlib import Path

import pytest

from tools.changed_tests import changed, choose

pytest_plugins = ["pytester"]


def write(root: Path, files: dict[str, str]) -> None:
    for name, text in files.items():
        (root / name).parent.mkdir(parents=True, exist_ok=True)
        (root / name).write_text(text)


@pytest.fixture
def checkout(tmp_path: Path) -> Path:
    write(
        tmp_path,
        {
            "rig/contact.py": "",
            "rig/other.py": "",
            "tests/helper.py": "",
            "tests/rig/test_contact.py": "",
            "tests/rig/test_contact_far.py": "",
            "tests/rig/test_other.py": "from rig import other",
            "tests/test_all.py": "import rig.contact\nfrom tests.helper import thing",
            "tests/test_docs.py": "",
            "docs/page.md": "",
        },
    )
    return tmp_path


def test_mirrored_tests_come_before_importing_ones(checkout: Path) -> None:
    near = ["tests/rig/test_contact.py", "tests/rig/test_contact_far.py", "tests/test_all.py"]
    assert choose(["rig/contact.py"], checkout) == near


def test_a_changed_test_comes_first_and_once(checkout: Path) -> None:
    assert choose(["rig/contact.py", "tests/test_all.py"], checkout)[0] == "tests/test_all.py"
    assert choose(["rig/contact.py", "tests/test_all.py"], checkout).count("tests/test_all.py") == 1


def test_a_name_from_a_package_is_an_import_of_the_module(checkout: Path) -> None:
    assert choose(["rig/other.py"], checkout) == ["tests/rig/test_other.py"]


def test_helpers_and_documents_have_tests_too(checkout: Path) -> None:
    assert choose(["tests/helper.py"], checkout) == ["tests/test_all.py"]
    assert choose(["docs/page.md"], checkout) == ["tests/test_docs.py"]


def test_a_deleted_module_still_calls_for_those_that_import_it(checkout: Path) -> None:
    (checkout / "rig/contact.py").unlink()
    assert "tests/test_all.py" in choose(["rig/contact.py"], checkout)


def git(root: Path, *words: str) -> None:
    author = ["-c", "user.name=a", "-c", "user.email=a@example.org"]
    subprocess.run(["git", *author, *words], cwd=root, check=True, capture_output=True)


def test_changes_count_from_where_the_branch_left_main(checkout: Path) -> None:
    git(checkout, "init", "--initial-branch", "main")
    git(checkout, "add", ".")
    git(checkout, "commit", "-m", "Begin")
    git(checkout, "switch", "--create", "branch")
    write(checkout, {"rig/contact.py": "a = 1"})
    git(checkout, "commit", "--all", "-m", "Change")
    write(checkout, {"rig/other.py": "b = 2", "rig/new.py": ""})
    assert changed(checkout) == ["rig/contact.py", "rig/new.py", "rig/other.py"]


def test_on_main_the_last_commit_counts(checkout: Path) -> None:
    git(checkout, "init", "--initial-branch", "main")
    git(checkout, "add", ".")
    git(checkout, "commit", "-m", "Begin")
    write(checkout, {"rig/contact.py": "a = 1"})
    git(checkout, "commit", "--all", "-m", "Change")
    assert changed(checkout) == ["rig/contact.py"]


def test_what_time_does_not_suffice_for_is_skipped_and_said(pytester: pytest.Pytester) -> None:
    pytester.makepyfile("def test_long(clock): clock.append(18.1)\ndef test_left(): assert False\n")
    pytester.makeconftest(
        "import pytest\nfrom tools.changed_tests import Deadline\nCLOCK = [0.0]\n"
        "def pytest_configure(config): config.pluginmanager.register(Deadline(18.0, lambda: CLOCK[-1]))\n"
        "@pytest.fixture\ndef clock(): return CLOCK\n"
    )
    answer = pytester.runpytest("-rs", "-p", "no:xdist")
    answer.assert_outcomes(passed=1, skipped=1)
    answer.stdout.fnmatch_lines(["*no time left in `make check`; `make test` runs it*"])
