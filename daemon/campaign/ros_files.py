"""The parameter files of a robot's navigation package, loaded as its launch files load them."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Final

from daemon.campaign.settings import Settings, below, merged, settings_of
from grammars.diagnostics import Diagnostic, InputError, Severity, Where, did_you_mean
from grammars.documents import Document
from grammars.ros_yaml import load_ros_yaml

COMMON: Final = "costmap_common"
"""What launch files load into both costmaps, before what each has of its own."""
COSTMAPS: Final = (("move_base", "global_costmap"), ("move_base", "local_costmap"))


@dataclass(frozen=True, slots=True)
class _WellKnown:
    """A file of a navigation package: how it may be called, the namespace it is loaded into.

    Files about one ``section`` often leave its name out; they are then loaded into the section.
    """

    names: tuple[str, ...]
    namespace: str
    section: str = ""
    usual: bool = True


_WELL_KNOWN: Final = (
    _WellKnown(("amcl.yaml", "amcl_params.yaml"), "amcl"),
    _WellKnown(("costmap_common_params.yaml", "common_costmap_params.yaml"), COMMON),
    _WellKnown(
        ("costmap_global_params.yaml", "global_costmap_params.yaml"), "move_base", "global_costmap"
    ),
    _WellKnown(
        ("costmap_local_params.yaml", "local_costmap_params.yaml"), "move_base", "local_costmap"
    ),
    _WellKnown(("move_base_params.yaml", "move_base.yaml"), "move_base"),
    _WellKnown(
        ("navfn_global_planner_params.yaml", "navfn_params.yaml"), "move_base", "NavfnROS", False
    ),
    _WellKnown(("dwa_local_planner_params.yaml", "dwa_params.yaml"), "move_base", "DWAPlannerROS"),
)
"""In the order in which a usual launch file loads them: a later file wins."""


def load_folder(folder: Path, where: Where, warnings: list[Diagnostic], *, whole: bool) -> Settings:
    """Return the settings of the well-known files in ``folder``.

    ``where`` is the place that names the folder; with ``whole`` a usual file that is not there is
    worth a warning. Raises :class:`InputError` with everything wrong in the files.
    """
    if not folder.is_dir():
        raise InputError(Diagnostic(where, f"no folder {folder}", _folders_near(folder)))
    present = {path.name for path in folder.iterdir() if path.is_file()}
    named = {kind: name for kind in _WELL_KNOWN for name in kind.names[::-1] if name in present}
    if not named:
        expected = ", ".join(kind.names[0] for kind in _WELL_KNOWN)
        raise InputError(
            Diagnostic(where, f"{folder} has no parameter files", f"looked for {expected}")
        )
    settings: Settings = {}
    problems: list[Diagnostic] = []
    for kind in (kind for kind in _WELL_KNOWN if kind in named):
        try:
            settings = merged(settings, _load(folder / named[kind], kind, warnings))
        except InputError as error:
            problems += error.diagnostics
    if problems:
        raise InputError(problems)
    warnings += _left_aside(folder, present - set(named.values()), where)
    if whole:
        warnings += _missing(folder, named, where)
    return settings


def _load(path: Path, kind: _WellKnown, warnings: list[Diagnostic]) -> Settings:
    document, found = load_ros_yaml(path)
    warnings += found
    namespace = kind.namespace
    if kind.section and not any(_first(name) == kind.section for name in document.data):
        namespace = f"{namespace}/{kind.section}"
    return _settings(document, namespace)


def _left_aside(folder: Path, names: Iterable[str], where: Where) -> list[Diagnostic]:
    spare = sorted(name for name in names if name.endswith((".yaml", ".yml")))
    if not spare:
        return []
    message = f"not read in {folder}: {', '.join(spare)}"
    hint = 'name them under "files" with their namespace if the stack reads them'
    return [Diagnostic(where, message, hint, Severity.WARNING)]


def _missing(folder: Path, found: Iterable[_WellKnown], where: Where) -> list[Diagnostic]:
    lacking = [kind.names for kind in _WELL_KNOWN if kind.usual and kind not in found]
    return [
        Diagnostic(
            where, f"no {' or '.join(names)} in {folder}: ROS defaults apply", "", Severity.WARNING
        )
        for names in lacking
    ]


def load_files(
    files: Mapping[str, Iterable[tuple[Path, Where]]], warnings: list[Diagnostic]
) -> Settings:
    """Return the settings of files by the namespace they are loaded into, in the order written.

    Each file comes with the place that names it. Raises :class:`InputError` with everything wrong.
    """
    settings: Settings = {}
    problems: list[Diagnostic] = []
    for namespace, paths in files.items():
        for path, where in paths:
            if not path.is_file():
                problems.append(Diagnostic(where, f"no file {path}", _files_near(path)))
                continue
            try:
                document, found = load_ros_yaml(path)
                settings = merged(settings, _settings(document, namespace))
            except InputError as error:
                problems += error.diagnostics
                continue
            warnings += found
    if problems:
        raise InputError(problems)
    return settings


def _settings(document: Document, namespace: str) -> Settings:
    """Return the values of a file; names that begin with a slash leave the namespace."""
    leaving = {name: value for name, value in document.data.items() if name.startswith("/")}
    own = {name: value for name, value in document.data.items() if name not in leaving}
    base = tuple(part for part in namespace.split("/") if part)
    inside = settings_of(own, document.where, namespaces=True)
    return merged(below(inside, base), settings_of(leaving, document.where, namespaces=True))


def spread_common(settings: Settings) -> Settings:
    """Load what the costmaps have in common into each, below what each has of its own."""
    common = {path[1:]: s for path, s in settings.items() if path[0] == COMMON and len(path) > 1}
    own = {path: s for path, s in settings.items() if path[0] != COMMON}
    spread: Settings = {}
    for costmap in COSTMAPS:
        spread |= below(common, costmap)
    return merged(spread, own)


def _first(name: str) -> str:
    return next((part for part in name.split("/") if part), "")


def _files_near(path: Path) -> str:
    if not path.parent.is_dir():
        return f"there is no folder {path.parent}"
    return did_you_mean(path.name, (p.name for p in path.parent.iterdir() if p.is_file()))


def _folders_near(folder: Path) -> str:
    if not folder.parent.is_dir():
        return f"there is no folder {folder.parent}"
    return did_you_mean(folder.name, (p.name for p in folder.parent.iterdir() if p.is_dir()))
