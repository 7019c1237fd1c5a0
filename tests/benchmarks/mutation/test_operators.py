"""What is mutated and what is not, on sources of a line or two; expected mutants are written out by hand."""

import ast
from pathlib import Path

import pytest

from benchmarks.mutation.edits import edits
from benchmarks.mutation.mutants import mutants_of, mutated

ENUMS = {"Action": ("SOFT", "IMMEDIATE")}


def changes(source: str) -> list[str]:
    """The mutants of ``source``, as code."""
    count = len(list(edits(ast.parse(source), ENUMS)))
    return [ast.unparse(mutated(source, number, ENUMS)) for number in range(count)]


@pytest.mark.parametrize(
    ("source", "expected"),
    [
        ("x = 3", ["x = 4"]),
        ("x = 1000.0", ["x = 2000.0"]),
        ("x = True", ["x = False"]),
        ("x = None", ["x = ''"]),
        ("x = 'word'", ["x = 'XXwordXX'", "x = 'WORD'"]),
        ("x = a", ["x = None"]),
        ("x += a", ["x = a", "x -= a"]),
        ("x[2] = a", ["x[2] = None", "x[3] = a"]),
        ("return_(a < b)", ["pass", "return_(None)", "return_(a <= b)"]),
        ("return_(a and not b)", ["pass", "return_(None)", "return_(a or not b)", "return_(a and b)"]),
        ("return_(a is None)", ["pass", "return_(None)", "return_(a is not None)"]),
        ("f(min(a, b))", ["pass", "f(None)", "f(max(a, b))", "f(min(None, b))", "f(min(a, None))", "f(min(a))"]),
        ("f(a, k=b)", ["pass", "f(None, k=b)", "f(a, k=None)", "f(a)"]),
        ("f(Action.SOFT)", ["pass", "f(None)", "f(Action.IMMEDIATE)"]),
        ("f(a if b else c)", ["pass", "f(None)", "f(a)", "f(c)"]),
        ("T = ((a, 1), (b, 2))", [
            "T = None", "T = ((b, 2),)", "T = ((a, 1),)", "T = ((b, 2), (a, 1))", "T = ((a, 2), (b, 2))",
            "T = ((a, 1), (b, 3))",
        ]),
        ("S = {a, b}", ["S = None", "S = {b}", "S = {a}"]),
        ("D = {a: 1, b: 2}", ["D = None", "D = {b: 2}", "D = {a: 1}", "D = {a: 2, b: 2}", "D = {a: 1, b: 3}"]),
    ],
)  # fmt: skip
def test_each_kind_of_code_has_its_mutants(source: str, expected: list[str]) -> None:
    assert sorted(changes(source)) == sorted(expected)


@pytest.mark.parametrize(
    "source",
    [
        '"""A docstring."""',
        "import a",
        "assert a and b",
        "x: int",
        "raise DeviceError('a sentence for a person')",
        "Step = Zero | MoveTo",
        "@decorated(frozen=True)\nclass A:\n    pass",
        "Check = Callable[[int], str]",
    ],
)
def test_what_no_test_of_behaviour_can_see_has_none(source: str) -> None:
    assert changes(source) == []


def test_a_sentence_keeps_its_words_and_formats_but_not_its_figures() -> None:
    assert sorted(changes("def f():\n    return f'limit {2 * a:.1f} N'")) == [
        f"def f():\n    return f'limit {{{figure}:.1f}} N'" for figure in ("2 / a", "3 * a")
    ]


def test_a_name_that_is_put_together_is_no_sentence() -> None:
    assert "x = f'XX_NXX'" not in changes("x = f'{axis}_N'")
    assert "x = f'{axis}XX_NXX'" in changes("x = f'{axis}_N'")


def test_a_case_of_a_match_is_left_out_and_so_is_a_bound_in_an_annotation_mutated() -> None:
    match = "match a:\n    case 'x':\n        f()\n    case _:\n        g()"
    assert "match a:\n    case _:\n        g()" in changes(match)
    assert changes("class A:\n    x: Annotated[float, Field(ge=0)]") == [
        "class A:\n    x: Annotated[float, Field(ge=1)]"
    ]


def test_defaults_of_functions_and_bodies_of_properties_are_mutated() -> None:
    source = "class A:\n\n    @property\n    def p(self, x=1):\n        return self.a + x"
    assert changes(source) == [source.replace("x=1", "x=2"), source.replace("a +", "a -")]


def test_the_name_of_a_mutant_says_what_is_tried(tmp_path: Path) -> None:
    """To name a mutant that leaves out an argument must not hide those of the next argument."""
    path, source = tmp_path / "a.py", "def f(a):\n    g(k=1, m=2, n=a)\n    return h(a, a)"
    path.write_text(source)
    found = mutants_of(path, "a.py", ENUMS)
    assert [mutant.number for mutant in found] == list(range(len(changes(source))))
    tried = {mutant.name: ast.unparse(mutated(source, mutant.number, ENUMS)).splitlines() for mutant in found}
    assert tried["f: g(k=1, m=2, n=a) -> g(k=1, n=a)"][1] == "    g(k=1, n=a)"
    assert tried["f: h(a, a) -> h(None, a)"][2] == "    return h(None, a)"
    assert tried["f: h(a, a) -> h(a)"][2] == "    return h(a)"
