"""A mapping proposed for a folder nobody described, with what is doubtful in it and what cannot be known."""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import pairwise, product
from pathlib import Path

from rig.config.table import TomlTable
from rig.intake.aside import WAYS, Group, left_aside, nothing_found, untimed
from rig.intake.drives import drive_in
from rig.intake.families import INTERRUPTED, ColumnGroup, all_tables, groups_of
from rig.intake.folder import below, files_in
from rig.intake.labelling import Labels, labels_in, stated_in
from rig.intake.mapping import UNSAID, FileForm
from rig.intake.measured import beside, chosen, measured_in, ranks_of, spoilt
from rig.intake.naming import channels_of, names_of
from rig.intake.prose import with_prose
from rig.intake.questions import AxisQuestion, JointQuestion, OpenQuestion, Question, inline
from rig.intake.readers import kind_of
from rig.intake.senses import doubts_of_senses
from rig.intake.survey import texts_of
from rig.intake.text import open_texts
from rig.intake.timebase import clock_of, disorder_of, span_s
from rig.intake.units import ROTARY

Picked = list[tuple[TomlTable, Group, tuple[str, ...]]]
# A way and a force of a rotary axis whose lever nobody states: at this one a radian is a metre and a N m a N.
LEVER_MM = 1000.0
# Two loggers that are started by hand begin and end apart by more than this share of what they recorded.
CLOCKS_APART = 0.02
# A table of fewer rows in which no word is known is a list of settings or results.
FEWEST_ROWS = 10
# A sample may be lost where a program begins to write another table, but nobody starts a recording within two.
GOES_ON_STEPS = 2.0
# Of three questions people give up; what can be asked as one is.
MOST_QUESTIONS = 2
DRIVE = "are taken for a drive axis, which `rig diagnose` judges and `rig fit` refuses; for tissue take axis out"
OPEN, DOUBT = "# open: ", "# doubtful: "


@dataclass(frozen=True)
class Proposal:
    """A mapping as a table of TOML, what is doubtful in it, and what is still to be answered."""

    tree: TomlTable
    doubts: tuple[str, ...]
    questions: tuple[Question, ...]

    @property
    def text(self) -> str:
        """The mapping as a file."""
        head = [f"{DOUBT}{doubt}" for doubt in self.doubts]
        head += [f"{OPEN}{question.text}; {question.line}" for question in self.questions]
        session = "\n".join(f"{key} = {inline(value)}" for key, value in self.tree.items() if key != "tables")
        return "\n".join([*head, session, *map(_lines, self.tree["tables"])])

    def answered(self, answers: Sequence[str]) -> "Proposal":
        """The same with an answer to each question; raises UsageError where one is none."""
        for question, said in zip(self.questions, answers, strict=True):
            question.answer(self.tree, said)
        units = [
            (table, name, own.get("unit")) for table in self.tree["tables"] for name, own in table["columns"].items()
        ]
        turning = [table for table, name, unit in units if unit in ROTARY.get(name, {})]
        for table in turning:
            table["lever_mm"] = LEVER_MM
        said = f"a torque and an angle are taken at a lever of {LEVER_MM:g} mm; state lever_mm where it is another"
        return replace(self, questions=(), doubts=(*self.doubts, *([said] if turning else [])))


def propose(folder: Path) -> Proposal:
    """What the folder seems to hold; raises DataError where nothing in it may be a force and a position."""
    doubts, files = list[str](), files_in(folder)
    groups = [_in_one(group) for group in groups_of(list(with_prose(all_tables(files, doubts), folder)))]
    picked, recording = _picked(folder, groups)
    if not picked:
        raise nothing_found(folder, files, groups, doubts)
    tables, questions, names = list[TomlTable](), list[OpenQuestion](), dict[str, str]()
    for pattern, tables_alike, quantities in picked:
        group, empty = _with_numbers(tables_alike)
        # Tables below each other in a text are counted, so that none of them can be left out.
        aside = [table.layout.sheet.where for table in empty if kind_of(table.path) != "text"]
        doubts += [f"left aside, no numbers in its columns: {where}" for where in aside]
        if recording and "force" not in quantities:
            group = [beside(group[0], picked[0][1][0]), *group[1:]]
        table, templates, said, asked = _proposed(folder, group, quantities, pattern)
        tables.append(table)
        names |= templates
        doubts += said
        questions += [replace(question, tables=(len(tables) - 1,)) for question in asked]
    if recording:
        doubts += _two_clocks([group[0] for _, group, _ in picked], tables)
    doubts += untimed(groups, [table for _, group, _ in picked for table in group])
    doubts += left_aside(folder, files, [table for _, group, _ in picked for table in group])
    drives = [drive_in(group[0]) for _, group, _ in picked]
    may_be, sure = map(all, zip(*drives, strict=True))
    axis: TomlTable = {"axis": {} if sure else UNSAID} if may_be else {}
    doubts += [f"{by} {DRIVE}" for by, _ in drives if sure]
    asked_axis = [AxisQuestion(drives[0][0])] if may_be and not sure else []
    tree = {**_recording(picked), **names, **recording, **axis, "tables": tables}
    proposal = Proposal(tree, tuple(dict.fromkeys(doubts)), (*_few(list(_together(questions))), *asked_axis))
    return proposal if proposal.questions else proposal.answered([])


def _with_numbers(group: Group) -> tuple[Group, Group]:
    """The tables whose columns hold numbers as the others' do, and those where one is empty."""
    found = [len(chosen(table)) for table in group]
    whole = [table for table, count in zip(group, found, strict=True) if count == max(found)]
    return whole, [table for table, count in zip(group, found, strict=True) if count < max(found)]


def _in_one(group: Group) -> Group:
    """The tables as they are; those below each other in a text as one where time goes on from each to the next."""
    if not group[0].layout.form.get("repeats"):
        return group
    places = dict.fromkeys(table.layout.source for table in group)
    parts = [[table for table in group if table.layout.source == place] for place in places]
    if not all(_goes_on(*pair) for tables in parts for pair in pairwise(tables)):
        return group
    return [_whole(tables[0], len(tables)) for tables in parts]


def _whole(first: ColumnGroup, count: int) -> ColumnGroup:
    source, form = first.layout.source, {key: own for key, own in first.layout.form.items() if key != "repeats"}
    (sheet,) = open_texts(source, FileForm.model_construct(**form))
    said = f"its row of names comes {count} times while time goes on, so it is taken as one recording"
    broken = f"{first.path.name}: {said}; else say repeats = true"
    return replace(first, layout=first.layout._replace(sheet=sheet, form=form, broken=broken))


def _goes_on(table: ColumnGroup, following: ColumnGroup) -> bool:
    """Whether the next begins within two steps of time behind the last row of a table."""
    here, there = (span_s(part, clock_of(part)[0]) for part in (table, following))
    return bool(here and there and 0 < there[0] - here[1] <= GOES_ON_STEPS * (here[1] - here[0]) / table.rows)


def _picked(folder: Path, groups: Sequence[Group]) -> tuple[Picked, TomlTable]:
    """The groups that are taken, each with its own keys and quantities; what recordings of several files are called."""
    known = [(group, chosen(group[0])) for group in groups]
    both = [(group, found) for group, found in known if "force" in found and not found.keys().isdisjoint(WAYS)]
    both = [(group, found) for group, found in both if group[0].rows >= FEWEST_ROWS] or both
    best = min((ranks_of(group[0], "force")[found["force"]] for group, found in both), default=None)
    pair = _pair(folder, known, best)
    if pair:
        return pair
    if both:
        clocks = [clock_of(group[0]) for group, _ in both]
        timed = [item for item, (time, _, asked) in zip(both, clocks, strict=True) if time and not asked] or both
        return [({}, group, _quantities(found)) for group, found in timed], {}
    most = max((len(found) for _, found in known), default=0)
    asked = [(group, found) for group, found in known if len(found) == most and _may_be(group[0], found)]
    return [({}, group, _quantities(found)) for group, found in asked], {}


def _pair(
    folder: Path, known: Sequence[tuple[Group, Mapping[str, int]]], best: tuple[bool, int, int] | None
) -> tuple[Picked, TomlTable] | None:
    """Tables with force and with a way that go together by their names, if that force is surer than ``best``."""
    forces = [(group, found) for group, found in known if "force" in found and found.keys().isdisjoint(WAYS)]
    ways = [(group, found) for group, found in known if not found.keys().isdisjoint(WAYS)]
    for (force, found), (way, moved) in product(forces, ways):
        keys = _joined(folder, force, way)
        if keys and (best is None or ranks_of(force[0], "force")[found["force"]] < best):
            ours, theirs, recording = keys
            own = next(name for name in WAYS if name in moved)
            return [(ours, force, ("force",)), (theirs, way, (own,))], {"recording": recording}
    return None


def _joined(folder: Path, force: Group, way: Group) -> tuple[TomlTable, TomlTable, str] | None:
    """The keys of both that say which of them go together, sheets of a file or files, and the name of a recording."""
    if {table.layout.sheet.where for table in force} == {table.layout.sheet.where for table in way}:
        return {}, {}, "{file}-{sheet}" if force[0].layout.sheet.name else "{file}"
    if {table.path for table in force} == {table.path for table in way}:
        found = channels_of(*([table.layout.sheet.name for table in group] for group in (force, way)))
        name = found and found[2].replace("{folder}", "")
        return found and ({"sheets": found[0]}, {"sheets": found[1]}, "{file}" + (f"-{name}" if name else ""))
    found = channels_of(_stems(folder, force), _stems(folder, way))
    return found and ({"files": found[0] + _ending(force)}, {"files": found[1] + _ending(way)}, found[2])


def _two_clocks(both: Sequence[ColumnGroup], tables: Sequence[TomlTable]) -> Iterator[str]:
    """Marks the second of two tables as on a clock of its own where their times do not begin and end together."""
    spans = [span_s(table, made["time"]) for table, made in zip(both, tables, strict=True)]
    one = len({table.layout.sheet.where for table in both}) == 1 or all("section" in made for made in tables)
    if one or any(span is None for span in spans):
        return
    (start, end), (other_start, other_end) = (span for span in spans if span is not None)
    apart_s = abs((end - start) - (other_end - other_start)) + abs(start - other_start) * (start != 0 != other_start)
    if apart_s > CLOCKS_APART * (end - start):
        tables[1]["clock"] = "own"
        names = " and ".join(table.path.name for table in both)
        yield f"{names}: their times do not begin and end together; each is taken as a clock of its own"


def _quantities(found: Mapping[str, int]) -> tuple[str, ...]:
    return ("force", "velocity" if "velocity" in found else "position")


def _may_be(table: ColumnGroup, found: Mapping[str, int]) -> bool:
    """Whether numbers move in enough columns besides time to be force and position, in rows enough to see it."""
    time = _number(table, clock_of(table)[0])
    moving = [number for number, looks in table.looks.items() if looks.moves and number != time]
    lacking = ("force" not in found) + found.keys().isdisjoint(WAYS)
    taken = {time, *found.values(), *(number for quantity in found for number in table.fitting(quantity))}
    enough = (len(moving) >= 2 and table.rows >= FEWEST_ROWS) or (len(moving) >= 1 and bool(found))
    return enough and len(table.looks.keys() - taken) >= lacking


def _proposed(
    folder: Path, group: Group, quantities: Sequence[str], pattern: TomlTable
) -> tuple[TomlTable, TomlTable, list[str], list[OpenQuestion]]:
    """A table of the mapping with the ``pattern`` of its files or sheets, templates of names, doubts and questions."""
    first = group[0]
    time, doubts, asked = clock_of(first)
    at = None if {"wraps_at", "finer"} & time.keys() else _number(first, time)
    measured = measured_in(first, _number(first, time), quantities)
    files, templates = (pattern["files"], {}) if "files" in pattern else _files(folder, group)
    facts, stated = stated_in(group, templates)
    forms = [own.layout.form for own in group]
    table: TomlTable = {
        "files": files, **_sheets(group), **pattern, **first.layout.form,
        **{key: form[key] for form in forms for key in INTERRUPTED if key in form}, **_missing(group),
    }  # fmt: skip
    signs = [first.layout.sheet.number(own["sign"]) for own in measured.columns.values() if "sign" in own]
    taken = [number for number in (_number(first, time), *chosen(first).values(), *signs) if number is not None]
    labels = labels_in(first, taken, at)
    table |= {"label": labels.label} if labels.label is not None else {}
    table |= {"labels": {"part": first.index}} if first.index else {}
    table |= {"facts": facts} if facts else {}
    orders = [disorder_of(own, at, labels) for own in group] if at is not None else []
    disorder, late = max(orders, default=("", []))  # where one has it, a restart before rows that are dropped
    table |= {"disorder": disorder} if late else {}
    table |= {"time": time, "columns": measured.columns}
    spoils = [said for table in group for item in chosen(table).items() for said in spoilt(table, *item)]
    said = [
        *first.layout.doubts, *_broken(group), *doubts, *spoils, *measured.doubts, *labels.doubts, *late,
        *doubts_of_senses(first, chosen(first), measured.columns),
    ]  # fmt: skip
    templates |= {**stated, **labels.templates, **_apart(group, labels)}
    return table, templates, said, [*asked, *measured.questions]


def _apart(group: Group, labels: Labels) -> TomlTable:
    """What recordings are called where labels come again in another file or sheet: by both."""
    named = labels.templates.get("recording", "{label}")
    places = labels.label if isinstance(labels.label, dict) else {"label": labels.label}
    telling = [place for name, place in places.items() if place is not None and f"{{{name}}}" in named]
    if not telling:
        return {}
    sheets = [table.layout.sheet for table in group]
    found = [texts_of(sheet, [sheet.number(place) for place in telling]).values() for sheet in sheets]
    names = [set(zip(*columns, strict=True)) for columns in found]
    alone = not _recording([({}, group, ())]) and sum(map(len, names)) == len(set().union(*names))
    return {} if alone else {"recording": f"{_place(group)}-{named}"}


def _number(table: ColumnGroup, time: TomlTable) -> int | None:
    return table.layout.sheet.number(time["column"]) if "column" in time else None


def _broken(group: Group) -> Iterator[str]:
    """What is said of lines that are no rows in the first file that has them, and in how many more there are some."""
    found = {table.path: table.layout.broken for table in group if table.layout.broken}
    more = f" (and so in {len(found) - 1} more files)" if len(found) > 1 else ""
    yield from (said + more for said in list(found.values())[:1])


def _missing(group: Group) -> TomlTable:
    """The words and numbers that stand for none in any of the tables, with those that always do."""
    found = dict.fromkeys(word for table in group for looks in table.looks.values() for word in looks.missing)
    usual = FileForm.model_fields["missing"].default
    return {"missing": [*usual, *(word for word in found if word not in usual)]} if set(found) - set(usual) else {}


def _files(folder: Path, group: Group) -> tuple[str | list[str], TomlTable]:
    """A pattern that names these files and no others of the folder, with what varies in their names; or their list."""
    chosen_files = list(dict.fromkeys(table.path for table in group))
    ending = _ending(group)
    if folder.is_dir() and ending is not None:
        beside = [path for path in files_in(folder) if path.name.endswith(ending) and path not in chosen_files]
        names = names_of(_stems(folder, group), [below(folder, path).removesuffix(ending) for path in beside])
        if names or not beside:
            return (names.files + ending, names.templates) if names else (f"**/*{ending}", {})
    return sorted(below(folder, path) for path in chosen_files), {}


def _ending(group: Group) -> str:
    path = group[0].path
    return "".join(path.suffixes[-2:]) if path.suffix == ".gz" else path.suffix


def _stems(folder: Path, group: Group) -> list[str]:
    names = dict.fromkeys(below(folder, table.path) for table in group)
    return [name.removesuffix(_ending(group)) for name in names]


def _sheets(group: Group) -> TomlTable:
    if kind_of(group[0].path) == "text":  # whose tables are counted, in each file others
        return {}
    names = list(dict.fromkeys(table.layout.source.sheet for table in group if table.layout.source.sheet))
    return {"sheets": names} if names else {}


def _recording(picked: Picked) -> TomlTable:
    """What tells recordings apart where the names of files do not."""
    template = _place([table for _, group, _ in picked for table in group])
    return {"recording": template} if template.startswith("{folder}") or template.endswith("{part}") else {}


def _place(tables: Group) -> str:
    """A template of the file, with what else tells the tables apart."""
    paths = list(dict.fromkeys(table.path for table in tables))
    folders = "{folder}-" if len({path.name for path in paths}) < len(paths) else ""
    sheets = "-{sheet}" if any(table.layout.sheet.name for table in tables) else ""
    parts = "-{part}" if any(table.index for table in tables) else ""
    return f"{folders}{{file}}{sheets}{parts}"


def _together(questions: Sequence[OpenQuestion]) -> Iterator[OpenQuestion]:
    """One question for all tables that ask the same of their columns."""
    kept: dict[object, OpenQuestion] = {}
    for question in questions:
        rate = "" if question.choices else (question.known, question.example)
        key = (question.quantity, len(question.choices) == 1, question.choices[1:] and question.choices, rate)
        first = kept.setdefault(repr(key), question)
        kept[repr(key)] = replace(first, tables=tuple(dict.fromkeys((*first.tables, *question.tables))))
    yield from kept.values()


def _few(questions: Sequence[OpenQuestion]) -> Sequence[Question]:
    """At most as many as people answer, where questions of columns of the same tables can be asked as one."""
    columns = [question for question in questions if question.quantity != "time"]
    if len(questions) <= MOST_QUESTIONS or len({question.tables for question in columns}) > 1:
        return questions
    return [*(question for question in questions if question.quantity == "time"), JointQuestion(tuple(columns))]


def _lines(table: TomlTable) -> str:
    plain = [f"{key} = {inline(value)}" for key, value in table.items() if key != "columns"]
    columns = [f"columns.{quantity} = {inline(value)}" for quantity, value in table["columns"].items()]
    return "\n".join(["\n[[tables]]", *plain, *columns]) + "\n"
