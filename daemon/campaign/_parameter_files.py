"""Parameters in layers, from the parameter files of ROS 1 that the key ``ros`` names.

A later layer changes the values that it names and keeps the others; ``null`` removes an inherited
value. Every value has its path and its place in a file.

The parameter files of a robot's navigation package are loaded as its launch files load them, by
their usual names from a folder. A file that is like another may contain only differences, such as
another arg: the launch files are then read again with it.
"""

from __future__ import annotations

import os
import re
from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass, fields
from functools import partial, reduce
from pathlib import Path
from typing import Annotated, Any, Final, TypeAlias

from pydantic import Field

from grammars.text.diagnostics import Finding, InputError, Severity, Where, did_you_mean, gather
from grammars.text.documents import (
    ONE_OR_MORE,
    KeyPath,
    StrictModel,
    YamlDocument,
    leaves,
    paths_inside,
    text_or,
)
from grammars.text.ros_yaml import ParameterValue, load_ros_yaml
from grammars.text.sources import is_file, is_folder, names_in, note_read
from grammars.text.words import first_words

ParameterPath: TypeAlias = tuple[str, ...]
ParameterValues: TypeAlias = dict[ParameterPath, ParameterValue]


def flatten_parameters(
    tree: Mapping[str, Any], where: Callable[[KeyPath], Where], *, namespaces: bool = False
) -> ParameterValues:
    """Return the settings of nested mappings; ``where`` places the value at a path of ``tree``.

    With ``namespaces`` a name such as ``move_base/global_costmap`` means two levels.
    """
    values: ParameterValues = {}
    above: set[ParameterPath] = set()
    for keys, value in leaves(tree):
        path = tuple(p for name in keys for p in name.split("/") if p) if namespaces else keys
        inside = {below: where((*keys, *below)) for below in paths_inside(value)}
        _put(values, above, path, ParameterValue(value, where(keys), inside=inside))
    return values


def under_namespace(settings: ParameterValues, namespace: ParameterPath) -> ParameterValues:
    """Return the settings moved below ``namespace``."""
    return {(*namespace, *path): setting for path, setting in settings.items()}


def merge_parameters(base: ParameterValues, over: ParameterValues) -> ParameterValues:
    """Return ``base`` changed by ``over``.

    Raises :class:`InputError` for a ``null`` without an inherited value.
    """
    # Check against the base, not the result: two lines of one file may each remove a value.
    result = dict(base)
    namespaces = _namespaces(base)
    for path, setting in over.items():
        if setting.value is None and not is_inherited(path, base):
            message = f"{path[-1]}: null removes an inherited value, but there is none"
            raise InputError(Finding(setting.where, message, "write a value or leave it out"))
        _put(result, namespaces, path, setting)
        if setting.value is None:
            del result[path]
    return result


def is_inherited(path: ParameterPath, base: ParameterValues) -> bool:
    """Return whether there is a value at ``path``, above it or below it."""
    return any(_shares(path, old) for old in base)


def _namespaces(paths: Iterable[ParameterPath]) -> set[ParameterPath]:
    """Return every beginning of the paths."""
    return {path[:length] for path in paths for length in range(1, len(path))}


def _put(
    settings: ParameterValues,
    namespaces: set[ParameterPath],
    path: ParameterPath,
    setting: ParameterValue,
) -> None:
    """Set one value in place of any value at its path, above it or below it.

    ``namespaces`` contain at least those of the settings: a search through all settings for each
    value would take minutes for the largest files.
    """
    below: list[ParameterPath] = []
    if path in namespaces:
        below = [old for old in settings if len(old) > len(path) and _shares(old, path)]
    # An empty mapping in a file removes no values below it.
    if setting.value == {} and below:
        return
    above = [path[:length] for length in range(1, len(path)) if path[:length] in settings]
    for old in (*above, *below):
        del settings[old]
    settings[path] = setting
    namespaces |= _namespaces([path])


def _shares(one: ParameterPath, other: ParameterPath) -> bool:
    """Return whether one path is the beginning of the other."""
    shorter = min(len(one), len(other))
    return one[:shorter] == other[:shorter]


def parameter_tree(settings: ParameterValues) -> dict[str, Any]:
    """Return settings as nested dicts in alphabetical order.

    The digest of a run then does not depend on the order of lines in files.
    """
    tree: dict[str, Any] = {}
    for path, setting in sorted(settings.items(), key=lambda item: item[0]):
        node = tree
        for name in path[:-1]:
            node = node.setdefault(name, {})
        node[path[-1]] = setting.value
    return tree


def parameter_place(settings: ParameterValues, path: tuple[str | int, ...]) -> Where | None:
    """Return the place of the value at ``path``, otherwise of the nearest one above or below."""
    first_index = next((i for i, part in enumerate(path) if isinstance(part, int)), len(path))
    names = tuple(part for part in path[:first_index] if isinstance(part, str))
    for length in range(len(names), 0, -1):
        prefix = names[:length]
        if prefix in settings:
            return _nearest(settings[prefix], path[length:])
        inside = [s.where for p, s in settings.items() if p[:length] == prefix]
        if inside:
            return inside[0]
    return None


def _nearest(setting: ParameterValue, below: KeyPath) -> Where:
    """Return the place of the item at ``below`` in a list, or of the nearest one around it."""
    for length in range(len(below), 0, -1):
        if below[:length] in setting.inside:
            return setting.inside[below[:length]]
    return setting.where


_Texts: TypeAlias = Annotated[list[Annotated[str, Field(min_length=1)]], ONE_OR_MORE]
_Text: TypeAlias = Annotated[str, text_or(bool, int, float)]


class RosSource(StrictModel):
    """Source of the configuration of a robot: launch files, read as roslaunch reads them."""

    folder: str | None = Field(default=None, min_length=1)
    """A folder with the parameter files of a robot's navigation package (amcl.yaml,
    costmap_common_params.yaml, move_base_params.yaml ...), loaded as by usual launch files.
    "ros: FOLDER" is the same."""
    launch: _Texts = Field(default_factory=list)
    """Launch files (XML) that start move_base and amcl, one after the other."""
    args: dict[str, _Text] = Field(default_factory=dict)
    """Args for the launch files, as on the command line of roslaunch."""
    packages: _Texts = Field(default_factory=list)
    """Folders that are or contain packages, for $(find PACKAGE); those of the launch files need no
    entry."""
    env: dict[str, _Text] = Field(default_factory=dict)
    """Environment variables for $(env NAME) and $(optenv NAME); the shell's are ignored."""
    skip: _Texts = Field(default_factory=list)
    """Endings of files to leave out when launch files load or include them."""
    node: str | None = Field(default=None, pattern=r"^/?[A-Za-z][A-Za-z0-9_/]*$")
    """The full name of the move_base to test, if the launch files start several."""

    @property
    def is_change(self) -> bool:
        """True if it changes the launch files of another SUT file."""
        return not self.folder and not self.launch


def as_ros_source(value: Any) -> Any:
    """Turn a plain text into the key ``folder``."""
    return {"folder": value} if isinstance(value, str) else value


_LAUNCH_KEYS: Final = ("args", "packages", "env", "skip", "node")


@dataclass(frozen=True, slots=True)
class LaunchChange:
    """Settings of one SUT file for launch files; paths in ``source`` are relative to ``folder``."""

    source: RosSource
    document: YamlDocument
    folder: Path

    def where(self, *path: str | int) -> Where:
        """Return the place of a key below ``ros``."""
        return self.document.where(("ros", *path))


def check_source(change: LaunchChange) -> None:
    """Raise :class:`InputError` for keys of ``ros`` that exclude each other."""
    source = change.source
    if not source.folder:
        if source.is_change and not any(getattr(source, key) for key in _LAUNCH_KEYS):
            message = "ros: names neither a folder nor launch files"
            raise InputError.at(change.where(), message, 'write "launch: FILE", or a folder')
        return
    for key in ("launch", *_LAUNCH_KEYS):
        if getattr(source, key):
            message = f"{key}: a folder is read without launch files"
            raise InputError.at(change.where(key), message, "write folder or launch, not both")


def refuse_lone_changes(changes: tuple[LaunchChange, ...]) -> None:
    """Refuse settings for launch files if no SUT file below names any."""
    if changes:
        raise InputError(
            Finding(
                change.where(),
                "ros: there are no launch files to change, here or in its base",
                'write "launch: FILE" or a folder',
            )
            for change in changes
        )


_COMMON: Final = "costmap_common"
"""Values that launch files load into both costmaps, below the own values of each."""
_COSTMAPS: Final = (("move_base", "global_costmap"), ("move_base", "local_costmap"))


@dataclass(frozen=True, slots=True)
class _PackageFile:
    """A file of a navigation package: its possible names, the namespace it is loaded into.

    Files about one ``section`` often omit its name; they are then loaded into the section. Without
    any file of a ``usual`` subject the defaults of ROS apply.
    """

    stems: str
    section: str = ""
    usual: str = ""
    namespace: str = "move_base"

    @property
    def names(self) -> list[str]:
        """The names of the file, the usual one first."""
        return [f"{stem}.yaml" for stem in self.stems.split()]

    def place(self, data: Mapping[str, Any]) -> str:
        """Return the namespace into which launch files load ``data``, by the names in it."""
        from daemon.stacks.ros1.move_base import MoveBaseParameters

        names = {name.lstrip("/").partition("/")[0] for name in data}
        if self.namespace in names:
            return ""
        if self.namespace == _COMMON and names & _SPACES:
            return "move_base"
        own = {field.name for field in fields(MoveBaseParameters)}
        is_whole = names <= own or any(
            name in _SPACES
            or name.endswith("PlannerROS")
            or (name in own and name not in _SHARED)
            or (isinstance(data.get(name), Mapping) and self.section not in _SPACES)
            for name in names
        )
        return "/".join(filter(None, (self.namespace, "" if is_whole else self.section)))


_SPACES: Final = frozenset({"global_costmap", "local_costmap"})
_SHARED: Final = frozenset({"controller_frequency", "latch_xy_goal_tolerance"})
"""Names that move_base and its local planners read."""
_PACKAGE_FILES: Final = (
    _PackageFile("amcl amcl_params", "", "amcl", "amcl"),
    _PackageFile(f"{_COMMON}_params common_costmap_params {_COMMON}", "", _COMMON, _COMMON),
    *(
        _PackageFile(
            f"costmap_{one}_params {one}_costmap_params costmap_{one} {one}_costmap "
            f"costmap_{one}_static",
            *(f"{one}_costmap", one),
        )
        for one in ("global", "local")
    ),
    _PackageFile("move_base_params move_base move_base_common_params", "", "move_base"),
    _PackageFile("planner planner_params local_planner_params", "", "planner"),
    _PackageFile("navfn_global_planner_params navfn_params", "NavfnROS"),
    _PackageFile("global_planner_params global_planner", "GlobalPlanner"),
    _PackageFile("base_local_planner_params trajectory_planner", "TrajectoryPlannerROS", "planner"),
    _PackageFile("dwa_local_planner_params dwa_params", "DWAPlannerROS", "planner"),
)
"""Package files in the order of a usual launch file: a later file wins."""


def load_package_folder(
    folder: Path, where: Where, warnings: list[Finding], *, whole: bool
) -> ParameterValues:
    """Return the settings of the well-known files in ``folder``.

    ``where`` is the place that names the folder. With ``whole``, missing usual files cause
    warnings. Raises :class:`InputError` with all errors in the files.
    """
    if not is_folder(folder):
        raise InputError(Finding(where, f"no folder {folder}", _near(folder, is_folder)))
    # Of two names for the same file the usual one wins: it is the last in reversed order.
    names = names_in(folder)
    present = {re.sub(r"\.yml$", ".yaml", name): name for name in sorted(names, reverse=True)}
    named = {
        kind: present[name]
        for kind in _PACKAGE_FILES
        for name in kind.names[::-1]
        if name in present
    }
    if not named:
        message = f"{folder} has no parameter files"
        raise InputError(Finding(where, message, _instead_of_files(folder, names)))
    warnings += _unread_files(folder, set(names) - set(named.values()), where)
    settings = _load_files(
        partial(_load, folder / named[kind], kind.place, warnings)
        for kind in _PACKAGE_FILES
        if kind in named
    )
    if whole:
        warnings += _missing_files(folder, named, settings, where)
    return settings


def load_parameter_files(
    files: Mapping[str, Iterable[tuple[Path, Where]]], warnings: list[Finding]
) -> ParameterValues:
    """Return the settings of files, which are given by their namespace, in order.

    Each file comes with the place that names it. Raises :class:`InputError` with all errors.
    """

    def load(namespace: str, path: Path, where: Where) -> ParameterValues:
        if not is_file(path):
            raise InputError(Finding(where, f"no file {path}", _near(path)))
        return _load(path, lambda _: namespace, warnings)

    return _load_files(
        partial(load, namespace, path, where)
        for namespace, paths in files.items()
        for path, where in paths
    )


def _load_files(loads: Iterable[Callable[[], ParameterValues]]) -> ParameterValues:
    """Return the settings of files; later files win."""
    return reduce(merge_parameters, gather(loads), {})


def _load(
    path: Path, place: Callable[[Mapping[str, Any]], str], warnings: list[Finding]
) -> ParameterValues:
    """Return the values of a file below the namespace that ``place`` returns for them.

    Names that begin with a slash leave the namespace.
    """
    document, findings = load_ros_yaml(path)
    _refuse_nav2(document)
    warnings += findings
    namespace = place(document.data)
    leaving = {name: value for name, value in document.data.items() if name.startswith("/")}
    own = {name: value for name, value in document.data.items() if name not in leaving}
    base = tuple(part for part in namespace.split("/") if part)
    inside = flatten_parameters(own, document.where, namespaces=True)
    return merge_parameters(
        under_namespace(inside, base), flatten_parameters(leaving, document.where, namespaces=True)
    )


def _instead_of_files(folder: Path, names: Iterable[str]) -> str:
    """Return a hint on the likely content of a folder without the usual files."""
    yaml = sorted(name for name in names if name.endswith((".yaml", ".yml")))
    for name in yaml:
        if _is_of_ros2(folder / name):
            return f'{name} is for ROS 2: test Nav2 by "kind: ros2" (docs/ros2.md)'
    launch = [*sorted(folder.glob("*.launch*")), *sorted(folder.glob("launch/*.launch*"))]
    if launch:
        listed = ", ".join(str(path.relative_to(folder)) for path in launch[:6])
        return f'it has launch files ({listed}): write "ros: {{launch: FILE}}" to read one'
    return f"looked for {', '.join(name for kind in _PACKAGE_FILES for name in kind.names)}"


def _unread_files(folder: Path, names: Iterable[str], where: Where) -> list[Finding]:
    """Return warnings about files of other names, first about those that look like ROS files."""
    spare = sorted(name for name in names if name.endswith((".yaml", ".yml")))
    groups: dict[str, list[str]] = {}
    for name in spare:
        groups.setdefault(_likely_namespace(folder / name), []).append(name)
    findings = []
    for space, alike in sorted(groups.items(), reverse=True):
        message = f"not read in {folder}: {first_words(alike)}"
        hint = 'name them under "files" with their namespace if the stack reads them'
        if space:
            message += f", with names that {space.partition('/')[0]} reads"
            path = os.path.relpath(folder / alike[0], Path(where.file).parent)
            hint = f'write "files: {{{space}: {path}}}" to read one'
        findings.append(Finding(where, message, hint, Severity.WARNING))
    return findings


_TELLING: Final[Mapping[str, str]] = {
    "move_base": "base_local_planner base_global_planner recovery_behaviors planner_frequency "
    "global_costmap local_costmap TrajectoryPlannerROS DWAPlannerROS TebLocalPlannerROS",
    "amcl": "odom_model_type laser_model_type min_particles odom_alpha1 update_min_d",
    _COMMON: "footprint robot_radius observation_sources inflation_radius plugins global_frame "
    "obstacle_layer inflation_layer",
    "move_base/DWAPlannerROS": "max_vel_x max_vel_trans acc_lim_x sim_time",
}
"""Names by which to recognise files, by namespace."""


def _likely_namespace(path: Path) -> str:
    """Return the namespace of the names in a file, if any."""
    try:
        names = set(load_ros_yaml(path)[0].data)
    except InputError:
        return ""
    space = next((space for space, known in _TELLING.items() if names & set(known.split())), "")
    which = next((one for one in _SPACES if one.partition("_")[0] in path.name), "")
    return f"move_base/{which}" if space == _COMMON and which else space


def _missing_files(
    folder: Path, present: Iterable[_PackageFile], settings: ParameterValues, where: Where
) -> list[Finding]:
    spaces = _namespaces(settings)
    inside = [k.usual for k in _PACKAGE_FILES if (k.namespace, k.section) in spaces]
    subjects = {"", *inside, *(kind.usual for kind in present)}
    lacking = [kind for kind in _PACKAGE_FILES if kind.usual not in subjects]
    usual = {kind.usual: kind.names[0] for kind in lacking}
    if not usual:
        return []
    message = f"no {first_words(usual.values())} in {folder}: ROS defaults apply"
    names = [path for kind in lacking for name in kind.names for path in folder.glob(f"*/{name}")]
    hint = "docs/languages/systems-under-test.md lists the names of files that are read"
    if names:
        hint = f"name {first_words(names)} under files, if it is the one; {hint}"
    return [Finding(where, message, hint, Severity.WARNING)]


def _near(path: Path, pick: Callable[[Path], bool] = is_file) -> str:
    """Propose a similar name beside ``path``, among those that ``pick`` accepts."""
    if not is_folder(path.parent):
        return f"there is no folder {path.parent}"
    return did_you_mean(path.name, names_in(path.parent, pick))


def apply_common_costmap(settings: ParameterValues) -> ParameterValues:
    """Load the common values of the costmaps into each, below its own values."""
    common = {path: s for path, s in settings.items() if path[0] == _COMMON}
    own = {path: s for path, s in settings.items() if path[0] != _COMMON}
    return merge_parameters(spread_common(common, {}), own)


def spread_common(changes: ParameterValues, base: ParameterValues) -> ParameterValues:
    """Return ``changes`` to ``base`` with those of both costmaps written out for each.

    Launch files load common values into each costmap themselves; otherwise those would win over a
    change of both.
    """
    common = {path[1:]: s for path, s in changes.items() if path[0] == _COMMON and len(path) > 1}
    spread: ParameterValues = {}
    for path, setting in common.items():
        places = [(*costmap, *path) for costmap in _COSTMAPS]
        if setting.value is None:
            # A value of only one costmap is removed from that one alone.
            places = [one for one in places if is_inherited(one, base)] or places
        spread |= dict.fromkeys(places, setting)
    return spread | {path: s for path, s in changes.items() if path[0] != _COMMON}


_ROS2_MARK: Final = "ros__parameters"


def _refuse_nav2(document: YamlDocument) -> None:
    """Raise :class:`InputError` for a parameter file of ROS 2."""
    for path in document.places:
        if path[-1:] == (_ROS2_MARK,):
            message = f"is a parameter file of ROS 2 ({_ROS2_MARK}), which move_base does not read"
            hint = 'Nav2 itself is tested as an external system: "kind: ros2" (docs/ros2.md)'
            raise InputError.at(document.where(path), message, hint)


def _is_of_ros2(path: Path) -> bool:
    """Return whether a file looks like a parameter file of ROS 2."""
    note_read(path)
    with path.open("rb") as file:
        return _ROS2_MARK.encode() in file.read(2**20)
