"""What other distributions declare by entry points: each is admitted, or named with what is wrong and harms nothing.

The groups are `tissue_rig.force`, `.axis`, `.tracker`, `.input`, `.cause`, `.axis_cause` and `.law`. Two distributions
that declare one name are both refused: which of two drivers moves a tip is not left to the order of folders. Our own
products are declared in the same groups, by the distribution `tissue-rig` itself.
"""

import contextlib
import inspect
import sys
import traceback
from collections import Counter
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass, replace
from functools import cache, partial
from importlib.metadata import EntryPoint, entry_points
from typing import Any, Generic, TypeVar

from rig.deadline import within
from rig.errors import PluginError, RigError

Item = TypeVar("Item")
# Half of what a process of the bench has for its start, as each of them imports what is declared.
IMPORT_S = 5.0


@dataclass(frozen=True)
class Plugin:
    """One entry point: what it declares under ``name``, whose it is, and why it is not used; empty where it is."""

    group: str
    name: str
    distribution: str
    version: str
    declares: str = ""
    error: str = ""
    module: str = ""

    @property
    def sentence(self) -> str:
        """For a person."""
        return f"{self.group} {self.name!r} of {self.distribution} {self.version}: {self.error}"


@dataclass(frozen=True)
class Admission(Generic[Item]):
    """How a registry takes what is declared: its name, why it cannot be used, and how it is entered."""

    name_of: Callable[[Item], str]
    refusal: Callable[[object], str]
    register: Callable[[Item], object]


def subclass_of(kind: type) -> Callable[[object], str]:
    """What says why an object is no class of that ``kind``."""
    return lambda item: (
        "" if inspect.isclass(item) and issubclass(item, kind) else _expected(item, f"a subclass of {kind.__name__}")
    )


def instance_of(kind: type) -> Callable[[object], str]:
    """What says why an object is none of that ``kind``."""
    return lambda item: "" if isinstance(item, kind) else _expected(item, f"a {kind.__name__}")


def _expected(item: object, what: str) -> str:
    return f"is {item!r}, where {what} is expected"


def lacking(device: object, protocol: type, whole: bool = True) -> list[str]:
    """Members of ``protocol`` that ``device`` lacks; methods only of a class or unless ``whole``: others come later."""
    kinds = [kind for kind in protocol.__mro__ if vars(kind).get("_is_protocol")]
    members = {name: of for kind in kinds for name, of in (inspect.get_annotations(kind) | vars(kind)).items()}
    wanted = {name: inspect.isfunction(of) for name, of in members.items() if not name.startswith("_")}
    made = whole and not inspect.isclass(device)
    return sorted(name for name, called in wanted.items() if (called or made) and not _has(device, name, called))


def _has(device: object, name: str, called: bool) -> bool:
    if called:
        return callable(getattr(device, name, None))
    return inspect.getattr_static(device, name, _ABSENT) is not _ABSENT or hasattr(device, name)


# The distribution that this package is of.
OURS = "tissue-rig"
_ABSENT = object()
_met: dict[str, tuple[Plugin, ...]] = {}

# Looking through all distributions takes 10 ms.
_advertised = cache(entry_points)


def met() -> Mapping[str, tuple[Plugin, ...]]:
    """Every plug-in that was looked at so far, by group."""
    return _met


def declaring(group: str, name: str) -> Plugin | None:
    """The plug-in in use that declares ``name``; None where it is one of ours."""
    return next((one for one in _met.get(group, ()) if one.declares == name and not one.error), None)


def blamed(error: Exception) -> PluginError | None:
    """``error`` as that of the plug-in in whose code it arose, also in another process; None where it is in none's."""
    told = "".join(traceback.format_exception(error))
    used = [plugin for plugins in _met.values() for plugin in plugins if not plugin.error]
    places = {plugin: told.rfind(_place(plugin)) for plugin in used}
    last = max(places, key=lambda plugin: places[plugin], default=None)
    if last is None or places[last] < 0:
        return None
    what = " ".join(f"{type(error).__name__}: {error}".split())
    return PluginError(f"{replace(last, error=what).sentence}; see its maker, or uninstall it")


@contextlib.contextmanager
def blaming() -> Iterator[None]:
    """What arises in a plug-in's code is raised as its PluginError; everything else as it is."""
    try:
        yield
    except RigError:
        raise
    except Exception as error:
        theirs = blamed(error)
        if theirs is None:
            raise
        raise theirs from error


def _place(plugin: Plugin) -> str:
    """As lines of a traceback have it: the plug-in's file, or the folder of its package."""
    file = str(getattr(sys.modules.get(plugin.module), "__file__", None) or plugin.module)
    return f'File "{file.removesuffix("__init__.py")}'


def failures() -> Iterator[Plugin]:
    """Those that cannot be used."""
    return (plugin for plugins in _met.values() for plugin in plugins if plugin.error)


def hint() -> str:
    """Behind a name nobody knows: what failed or is not installed, as far as that may be why; empty where nothing."""
    failed = "; ".join(plugin.sentence for plugin in failures())
    said = f"; plug-ins that cannot be used: {failed}" if failed else ""
    commands = _advertised().select(group="console_scripts")
    return said if any(map(_is_ours, commands)) else f"{said}; {OURS} is not installed, and declares nothing"


def our_own(group: str) -> list[Any]:
    """What this package's own distribution declares in ``group``; none where it lies about without being installed."""
    return [point.load() for point in _advertised().select(group=group) if _is_ours(point)]


def _is_ours(point: EntryPoint) -> bool:
    return point.dist is not None and point.dist.name == OURS


def admit(group: str, admission: Admission[Item]) -> None:
    """Registers every usable entry point of ``group``; the others are kept with their error."""
    if not group:
        return
    loaded = partial(_loaded, admission)
    found = [loaded(point) for point in _advertised().select(group=group) if not _is_ours(point)]
    names = Counter(plugin.declares for plugin, _ in found if not plugin.error)
    _met[group] = tuple(_admitted(plugin, item, names, admission) for plugin, item in found)


def _loaded(admission: Admission[Item], point: EntryPoint) -> tuple[Plugin, Item | None]:
    whose, version = (point.dist.name, point.dist.version) if point.dist else ("a distribution", "")
    plugin = Plugin(point.group, point.name, whose, version, module=point.module.partition(".")[0])
    try:
        with within(IMPORT_S):
            item = point.load()
        error = admission.refusal(item)
        return (
            (replace(plugin, error=error), None) if error else (replace(plugin, declares=admission.name_of(item)), item)
        )
    except (Exception, SystemExit) as error:  # whatever a plug-in does while it is imported is its own failure
        return replace(plugin, error=f"{type(error).__name__}: {error}"), None


def _admitted(plugin: Plugin, item: Item | None, names: Counter[str], admission: Admission[Item]) -> Plugin:
    if item is None:
        return plugin
    if names[plugin.declares] > 1:
        return replace(plugin, error=f"{names[plugin.declares]} plug-ins declare {plugin.declares!r}; uninstall others")
    try:
        admission.register(item)
    except ValueError as error:
        return replace(plugin, error=f"{error}; give it another name")
    return plugin
