"""Parameter files of ROS 1, loaded into namespaces, or by their usual names from a folder.

The parameter files of a robot's navigation package are loaded as its launch files load them.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Final

from daemon.campaign._foreign_files import is_of_ros2, refuse_nav2
from daemon.campaign._parameters import (
    ParameterValues,
    flatten_parameters,
    is_inherited,
    merge_parameters,
    under_namespace,
)
from grammars.text.diagnostics import Diagnostic, InputError, Severity, Where, did_you_mean
from grammars.text.documents import YamlDocument
from grammars.text.ros_yaml import load_ros_yaml
from grammars.text.sources import is_file, is_folder, names_in

COMMON: Final = "costmap_common"
"""What launch files load into both costmaps, before what each has of its own."""
COSTMAPS: Final = (("move_base", "global_costmap"), ("move_base", "local_costmap"))


@dataclass(frozen=True, slots=True)
class _PackageFile:
    """A file of a navigation package: how it may be called, the namespace it is loaded into.

    Files about one ``section`` often leave its name out; they are then loaded into the section.
    """

    names: tuple[str, ...]
    namespace: str
    section: str = ""
    usual: bool = True


_PACKAGE_FILES: Final = (
    _PackageFile(("amcl.yaml", "amcl_params.yaml"), "amcl"),
    _PackageFile(("costmap_common_params.yaml", "common_costmap_params.yaml"), COMMON),
    _PackageFile(
        ("costmap_global_params.yaml", "global_costmap_params.yaml"), "move_base", "global_costmap"
    ),
    _PackageFile(
        ("costmap_local_params.yaml", "local_costmap_params.yaml"), "move_base", "local_costmap"
    ),
    _PackageFile(("move_base_params.yaml", "move_base.yaml"), "move_base"),
    _PackageFile(
        ("navfn_global_planner_params.yaml", "navfn_params.yaml"), "move_base", "NavfnROS", False
    ),
    _PackageFile(
        ("dwa_local_planner_params.yaml", "dwa_params.yaml"), "move_base", "DWAPlannerROS"
    ),
)
"""In the order in which a usual launch file loads them: a later file wins."""


def load_package_folder(
    folder: Path, where: Where, warnings: list[Diagnostic], *, whole: bool
) -> ParameterValues:
    """Return the settings of the well-known files in ``folder``.

    ``where`` is the place that names the folder; with ``whole`` a usual file that is not there is
    worth a warning. Raises :class:`InputError` with everything wrong in the files.
    """
    if not is_folder(folder):
        raise InputError(Diagnostic(where, f"no folder {folder}", _folders_near(folder)))
    # Of two names for the same file the usual one wins: it is the last in reversed order.
    present = set(names_in(folder))
    named = {kind: name for kind in _PACKAGE_FILES for name in kind.names[::-1] if name in present}
    if not named:
        raise InputError(
            Diagnostic(
                where, f"{folder} has no parameter files", _instead_of_files(folder, present)
            )
        )
    settings: ParameterValues = {}
    problems: list[Diagnostic] = []
    for kind in (kind for kind in _PACKAGE_FILES if kind in named):
        try:
            settings = merge_parameters(settings, _load(folder / named[kind], kind, warnings))
        except InputError as error:
            problems += error.diagnostics
    if problems:
        raise InputError(problems)
    warnings += _unread_files(folder, present - set(named.values()), where)
    if whole:
        warnings += _missing_files(folder, named, where)
    return settings


def _instead_of_files(folder: Path, names: Iterable[str]) -> str:
    """Say what a folder without the usual files may be."""
    yaml = sorted(name for name in names if name.endswith((".yaml", ".yml")))
    for name in yaml:
        if is_of_ros2(folder / name):
            return f'{name} is for ROS 2: test Nav2 by "kind: ros2" (docs/ros2.md)'
    launch = [*sorted(folder.glob("*.launch*")), *sorted(folder.glob("launch/*.launch*"))]
    if launch:
        listed = ", ".join(str(path.relative_to(folder)) for path in launch[:6])
        return f'it has launch files ({listed}): write "ros: {{launch: FILE}}" to read one'
    expected = ", ".join(kind.names[0] for kind in _PACKAGE_FILES)
    return f"looked for {expected}"


def _load(path: Path, kind: _PackageFile, warnings: list[Diagnostic]) -> ParameterValues:
    document, found = load_ros_yaml(path)
    refuse_nav2(document)
    warnings += found
    namespace = kind.namespace
    if kind.section and not any(_first_name(name) == kind.section for name in document.data):
        namespace = f"{namespace}/{kind.section}"
    return _document_parameters(document, namespace)


def _unread_files(folder: Path, names: Iterable[str], where: Where) -> list[Diagnostic]:
    spare = sorted(name for name in names if name.endswith((".yaml", ".yml")))
    if not spare:
        return []
    message = f"not read in {folder}: {', '.join(spare)}"
    hint = 'name them under "files" with their namespace if the stack reads them'
    return [Diagnostic(where, message, hint, Severity.WARNING)]


def _missing_files(folder: Path, found: Iterable[_PackageFile], where: Where) -> list[Diagnostic]:
    lacking = [kind.names for kind in _PACKAGE_FILES if kind.usual and kind not in found]
    return [
        Diagnostic(
            where, f"no {' or '.join(names)} in {folder}: ROS defaults apply", "", Severity.WARNING
        )
        for names in lacking
    ]


def load_parameter_files(
    files: Mapping[str, Iterable[tuple[Path, Where]]], warnings: list[Diagnostic]
) -> ParameterValues:
    """Return the settings of files by the namespace they are loaded into, in the order written.

    Each file comes with the place that names it. Raises :class:`InputError` with everything wrong.
    """
    settings: ParameterValues = {}
    problems: list[Diagnostic] = []
    for namespace, paths in files.items():
        for path, where in paths:
            if not is_file(path):
                problems.append(Diagnostic(where, f"no file {path}", _files_near(path)))
                continue
            try:
                document, found = load_ros_yaml(path)
                refuse_nav2(document)
                settings = merge_parameters(settings, _document_parameters(document, namespace))
            except InputError as error:
                problems += error.diagnostics
                continue
            warnings += found
    if problems:
        raise InputError(problems)
    return settings


def _document_parameters(document: YamlDocument, namespace: str) -> ParameterValues:
    """Return the values of a file; names that begin with a slash leave the namespace."""
    leaving = {name: value for name, value in document.data.items() if name.startswith("/")}
    own = {name: value for name, value in document.data.items() if name not in leaving}
    base = tuple(part for part in namespace.split("/") if part)
    inside = flatten_parameters(own, document.where, namespaces=True)
    return merge_parameters(
        under_namespace(inside, base), flatten_parameters(leaving, document.where, namespaces=True)
    )


def apply_common_costmap(settings: ParameterValues) -> ParameterValues:
    """Load what the costmaps have in common into each, below what each has of its own."""
    common = {path[1:]: s for path, s in settings.items() if path[0] == COMMON and len(path) > 1}
    own = {path: s for path, s in settings.items() if path[0] != COMMON}
    spread: ParameterValues = {}
    for costmap in COSTMAPS:
        spread |= under_namespace(common, costmap)
    return merge_parameters(spread, own)


def spread_common(found: ParameterValues, base: ParameterValues) -> ParameterValues:
    """Return ``found``, what it says of both costmaps said of each, to be put over ``base``.

    Over launch files, which load what is common into each costmap themselves, it would else lie
    below what it is to change.
    """
    common = {path[1:]: s for path, s in found.items() if path[0] == COMMON and len(path) > 1}
    spread: ParameterValues = {}
    for path, setting in common.items():
        places = [(*costmap, *path) for costmap in COSTMAPS]
        if setting.value is None:
            # What only one of them has can be taken away from that one alone.
            places = [one for one in places if is_inherited(one, base)] or places
        spread |= dict.fromkeys(places, setting)
    return spread | {path: s for path, s in found.items() if path[0] != COMMON}


def _first_name(name: str) -> str:
    return next((part for part in name.split("/") if part), "")


def _files_near(path: Path) -> str:
    if not is_folder(path.parent):
        return f"there is no folder {path.parent}"
    return did_you_mean(path.name, names_in(path.parent))


def _folders_near(folder: Path) -> str:
    if not is_folder(folder.parent):
        return f"there is no folder {folder.parent}"
    return did_you_mean(folder.name, names_in(folder.parent, is_folder))
