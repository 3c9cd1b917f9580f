"""Systems under test: files in layers on each other and on ROS parameter files, and as they run.

Values of a file win over those of its ROS files, and both over the system that it is ``like``. The
result is one tree of parameters; every finding about it has the place of its value. For a ROS 2
stack the tree holds the keys at the top of the file, as written.
"""

from __future__ import annotations

import re
import shlex
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import partial
from pathlib import Path
from typing import Annotated, Any, ClassVar, Final, TypeAlias

from pydantic import BeforeValidator, Field, field_validator

from daemon.campaign._parameter_files import (
    LaunchChange,
    ParameterPath,
    ParameterValues,
    RosSource,
    apply_common_costmap,
    as_ros_source,
    check_source,
    flatten_parameters,
    load_package_folder,
    load_parameter_files,
    merge_parameters,
    parameter_place,
    parameter_tree,
    refuse_lone_changes,
    spread_common,
)
from daemon.campaign._scenarios import MOST_LIKE, LayerReference
from daemon.model.attachments import SutMissing, attach_files
from daemon.model.spec import SutReference
from daemon.stacks.findings import ParameterError, ParameterFinding, ParameterFindings
from daemon.stacks.kind import StackKind
from daemon.stacks.registry import stack_kind
from daemon.stacks.ros2 import ROS2
from daemon.stacks.ros2.keys import Ros2Keys, default_for_null
from grammars.model.robot_files import CAMPAIGN_KEYS, MISSION_KEYS, ROBOT_KEYS
from grammars.text.diagnostics import Finding, InputError, Severity, Where
from grammars.text.documents import ONE_OR_MORE, RemovedKey, YamlDocument, load_yaml, read_model
from grammars.text.overrides import Override, split_key
from grammars.text.quantity import read_quantity
from grammars.text.ros_yaml import ParameterValue
from grammars.text.sources import is_file
from grammars.text.words import first_words

_MOST_NAMED: Final = 6
"""Most parameters without effect that a warning names."""

_MOST_ALIKE: Final = 3
"""Most warnings of one kind about parameters of one namespace."""

FindSutFile: TypeAlias = Callable[[Path, LayerReference], Path]
"""Finds the SUT file of a reference in a file of a folder; raises :class:`InputError`."""


class SutFile(Ros2Keys):
    """The keys of a file that describes a system under test."""

    elsewhere: ClassVar[Mapping[str, str | RemovedKey]] = {
        **Ros2Keys.elsewhere,
        **ROBOT_KEYS,
        **MISSION_KEYS,
        **CAMPAIGN_KEYS,
        "": 'differences from the defaults of its kind stand under "parameters:"',
    }
    _null = field_validator(*Ros2Keys.model_fields, mode="before")(default_for_null)

    sut: str = Field(pattern=r"^[A-Za-z0-9][A-Za-z0-9._-]{0,59}$", examples=["my-stack"])
    """Name of this system under test in verdicts."""
    about: str = ""
    """One line for people."""
    like: str | None = None
    """Another system under test: this one is the same except for the keys written here."""
    kind: str | None = None
    """Kind of the system: a shipped one, or a plug-in of "scenario.suts"."""
    ros: Annotated[
        RosSource | None,
        BeforeValidator(as_ros_source, json_schema_input_type=str | RosSource | None),
    ] = None
    """The unchanged configuration of a robot: its launch files, or a folder with the parameter
    files of its navigation package."""
    files: dict[str, Annotated[list[str], ONE_OR_MORE]] = Field(default_factory=dict)
    """ROS parameter files by namespace, such as move_base/global_costmap; costmap_common is loaded
    into both costmaps. For other kinds: files by names of your choice; they travel to the
    workers."""
    parameters: dict[str, Any] = Field(default_factory=dict)
    """Values that differ from the files, the base system and the defaults; null removes an
    inherited one. Not for "kind: ros2", which has keys of its own."""


@dataclass(frozen=True, slots=True)
class SutLayer:
    """A SUT file with all its bases, before its values are checked.

    ``files`` are its SUT files, itself first. ``attached`` are the files that travel to the
    workers. ``parameter_files`` are ROS files that people named, directly or by their folder.
    ``launched`` says whether it has launch files.
    """

    text: SutFile
    document: YamlDocument
    kind: StackKind[Any]
    settings: ParameterValues = field(default_factory=dict)
    files: tuple[str, ...] = ()
    warnings: tuple[Finding, ...] = ()
    attached: Mapping[str, Path] = field(default_factory=dict)
    parameter_files: tuple[str, ...] = ()
    launched: bool = False

    def changed(self, changes: ParameterValues) -> SutLayer:
        """Return the layer with changed values.

        Raises :class:`InputError` for a ``null`` without an inherited value.
        """
        if self.launched:
            changes = spread_common(changes, self.settings)
        return replace(self, settings=merge_parameters(self.settings, changes))


def kind_layer(kind: str, where: Where) -> SutLayer:
    """Return an empty file for a system that is named by its kind at ``where``.

    Raises :class:`SutMissing`.
    """
    text = SutFile.model_construct(sut=kind, kind=kind)
    return SutLayer(text, YamlDocument(where.file, {}, {(): where}, ""), stack_kind(kind))


def read_sut(
    path: Path,
    find: FindSutFile,
    warnings: list[Finding],
    above: tuple[Path, ...] = (),
    changes: tuple[LaunchChange, ...] = (),
) -> SutLayer:
    """Read a SUT file and its bases; ``changes`` to its launch files come from ``above``.

    ``warnings`` receives those about all its files.

    Raises :class:`InputError` for files that cannot be read or contradict each other.
    """
    document = load_yaml(path)
    text = read_model(document, SutFile)
    ros = None if text.ros is None else LaunchChange(text.ros, document, path.parent)
    below = changes
    if ros is not None:
        check_source(ros)
        below = (ros, *changes) if ros.source.is_change else ()
        changes = below or changes
    base = _base(path, document, text, find, warnings, above, below)
    kind = _kind(document, text, base)
    _refuse_keys_of_others(document, text, kind)
    layer = replace(base or SutLayer(text, document, kind), text=text, document=document)
    if ros is not None and ros.source.launch:
        # Only systems with launch files load their reader.
        from daemon.campaign._launch import load_launched

        settings = merge_parameters(layer.settings, load_launched(ros, changes, warnings))
        layer = replace(layer, settings=settings, launched=True)
    elif base is None or (ros is not None and ros.source.folder):
        refuse_lone_changes(changes)
    loaded: list[ParameterValues] = []
    if ros is not None and ros.source.folder:
        folder, where = path.parent / ros.source.folder, ros.where("folder")
        loaded.append(load_package_folder(folder, where, warnings, whole=base is None))
    files, attached = _named_files(path, document, text), layer.attached
    if kind.files == "parameters":
        loaded.append(load_parameter_files(files, warnings))
    else:
        attached = {**attached, **_attached(document, files)}
    for values in (*loaded, _own_values(document, text, kind)):
        layer = layer.changed(values)
    parameter_files = (setting.where.file for values in loaded for setting in values.values())
    return replace(
        layer,
        files=(str(path), *layer.files),
        warnings=tuple(warnings),
        attached=attached,
        parameter_files=tuple(dict.fromkeys((*layer.parameter_files, *parameter_files))),
    )


def _attached(
    document: YamlDocument, files: Mapping[str, Sequence[tuple[Path, Where]]]
) -> dict[str, Path]:
    """Return the files for the workers, by name."""
    attached: dict[str, Path] = {}
    for name, places in files.items():
        if len(places) != 1:
            where = document.where(("files", name))
            raise InputError(Finding(where, f"{name}: takes one file, not several"))
        ((path, _),) = places
        if not is_file(path):
            where = document.where(("files", name))
            raise InputError(Finding(where, f"{name}: no file {path}"))
        attached[name] = path
    return attached


def _base(
    path: Path,
    document: YamlDocument,
    text: SutFile,
    find: FindSutFile,
    warnings: list[Finding],
    above: tuple[Path, ...],
    changes: tuple[LaunchChange, ...],
) -> SutLayer | None:
    """Return the layer that this one is ``like``."""
    if text.like is None:
        return None
    where = document.where(("like",))
    chain = (*above, path.resolve())
    other = find(path.parent, LayerReference(text.like, {}, where))
    if other.resolve() in chain:
        circle = " -> ".join(p.stem for p in (*chain[chain.index(other.resolve()) :], other))
        raise InputError(Finding(where, f"like: goes round in a circle, {circle}"))
    if len(chain) > MOST_LIKE:
        message = f"like: more than {MOST_LIKE} files are like one another in a row"
        raise InputError(Finding(where, message, "be like one near the first of them"))
    return read_sut(other, find, warnings, chain, changes)


def _kind(document: YamlDocument, text: SutFile, base: SutLayer | None) -> StackKind[Any]:
    if base is None:
        if text.kind is None:
            hint = 'write "kind", or "like" with the name of another system under test'
            raise InputError(Finding(document.where(), 'key "kind" is missing', hint))
        try:
            return stack_kind(text.kind)
        except SutMissing as error:
            raise InputError(Finding(document.where(("kind",)), str(error))) from error
    if text.kind not in (None, base.kind.name):
        message = f"kind: {text.like} is of kind {base.kind.name}, so this one is as well"
        raise InputError(Finding(document.where(("kind",)), message, "leave it out"))
    return base.kind


def _named_files(
    path: Path, document: YamlDocument, text: SutFile
) -> dict[str, list[tuple[Path, Where]]]:
    return {
        namespace: [
            (path.parent / name, document.where(("files", namespace, index)))
            for index, name in enumerate(names)
        ]
        for namespace, names in text.files.items()
    }


def _refuse_keys_of_others(document: YamlDocument, text: SutFile, kind: StackKind[Any]) -> None:
    """Refuse keys at the top of a file that its kind does not have."""
    if text.ros is not None and kind.files != "parameters":
        message = f"ros: only kind ros reads ROS parameter files, this is {kind.name}"
        raise InputError(Finding(document.where(("ros",)), message))
    if text.files and kind.files == "none":
        message = f"files: {kind.name} needs none"
        raise InputError(Finding(document.where(("files",)), message))
    wrong, message, hint = ROS2.keys, f"only kind {ROS2.name} has this key, this is {kind.name}", ""
    if kind.keys:
        wrong = ("parameters",)
        message, hint = f"kind {kind.name} has none", "write its keys at the top: launch, topics …"
    keys = [key for key in wrong if key in document.data]
    if keys:
        raise InputError(Finding(document.where((k,)), f"{k}: {message}", hint) for k in keys)


def _own_values(document: YamlDocument, text: SutFile, kind: StackKind[Any]) -> ParameterValues:
    if kind.keys:
        keys = {key: document.data[key] for key in kind.keys if key in document.data}
        return flatten_parameters(keys, document.where)
    return flatten_parameters(text.parameters, lambda p: document.where(("parameters", *p)))


@dataclass(frozen=True, slots=True)
class LoadedSut:
    """A loaded system under test, with the place of each value and all findings.

    ``layer`` is the content of its files, ``settings`` are its values with those of the campaign.
    ``idle`` is the warning about values without effect, the last of the ``warnings``, if any.
    """

    reference: SutReference
    layer: SutLayer
    settings: ParameterValues
    findings: ParameterFindings
    warnings: tuple[Finding, ...]
    idle: tuple[Finding, ...] = ()


class RefusedSutError(InputError):
    """A system under test that cannot run; ``settings`` are the values it would have."""

    def __init__(self, diagnostics: list[Finding], settings: ParameterValues) -> None:
        super().__init__(diagnostics)
        self.settings = settings


def complete_sut(layer: SutLayer, overrides: Sequence[Override] = ()) -> LoadedSut:
    """Return the system under test of files, with other values for some parameters.

    Raises :class:`InputError` with all errors, each with its place.
    """
    if overrides:
        layer = layer.changed(_changes(overrides, layer))
    kind, document, settings = layer.kind, layer.document, layer.settings
    if kind.files == "parameters":
        settings = apply_common_costmap(settings)
    _refuse_missing(settings)
    tree = parameter_tree(settings)
    if kind.external:
        tree.setdefault("repeatable", False)
    reference = SutReference(layer.text.sut, kind.name, tree, _attach(layer))
    place = partial(_placed, document=document, settings=settings, severity=Severity.WARNING)
    try:
        findings = kind.findings(kind.read(reference.local_parameters))
    except ValueError as error:
        warnings = []
        if isinstance(error, ParameterError):
            # An unused file leaves the defaults in place, which may cause unrelated errors.
            _refuse_unread(settings, error.findings, layer.parameter_files)
            warnings = _warnings(error.findings, place)
        with InputError.keeping(warnings):
            raise RefusedSutError(_diagnostics(error, document, settings), settings) from error
    _refuse_unread(settings, findings, layer.parameter_files)
    warnings = _warnings(findings, place)
    idle = _idle_warning(findings, layer, settings)
    return LoadedSut(
        reference, layer, settings, findings, (*layer.warnings, *warnings, *idle), idle
    )


def _warnings(
    findings: ParameterFindings, place: Callable[[ParameterFinding], Finding]
) -> list[Finding]:
    """Return the warnings, each once, names that nothing reads first: they may cause the others.

    Of many alike in one namespace the first also names others.
    """
    groups: dict[object, list[ParameterFinding]] = {}
    for one in sorted(findings.problems, key=lambda one: not one.unread):
        kind = (one.path[:-1], *one.message.split()[:3])
        groups.setdefault(one if "did you mean" in one.hint else kind, []).append(one)
    warnings: list[Finding] = []
    for alike in groups.values():
        found = list(map(place, alike))
        if len(alike) > _MOST_ALIKE:
            others = first_words(one.path[-1] for one in alike[1:])
            found = [replace(found[0], message=f"{found[0].message}; the same with {others}")]
        warnings += found
    return list(dict.fromkeys(warnings))


def _refuse_missing(settings: ParameterValues) -> None:
    """Refuse values that launch files could not resolve and no SUT file replaces."""
    missing = [
        replace(lack, message=f"{lack.message}; {'/'.join(path)} has no value without it")
        for path, setting in settings.items()
        for lack in setting.missing
    ]
    if missing:
        raise InputError(missing)


def _attach(layer: SutLayer) -> dict[str, str]:
    where = layer.document.where(("files",))
    try:
        return attach_files(layer.attached)
    except ValueError as error:
        raise InputError(Finding(where, str(error))) from error
    except OSError as error:
        message = f"files: {error.filename} cannot be read: {error.strerror}"
        raise InputError(Finding(where, message)) from error


def _refuse_unread(
    settings: ParameterValues, findings: ParameterFindings, files: Iterable[str]
) -> None:
    """Raise :class:`InputError` for ``files`` without a single used parameter."""
    unread = {finding.path for finding in findings.problems if finding.unread}
    problems = []
    for file in files:
        own = {path: s for path, s in settings.items() if s.where.file == file}
        if own and all(any(path[:n] in unread for n in range(1, len(path) + 1)) for path in own):
            first, setting = next(iter(own.items()))
            message = f"no value of this file is read: {'/'.join(first)} is not a parameter here"
            problems.append(Finding(setting.where, message, _remedy(own)))
    if problems:
        raise InputError(problems)


_SECTIONS: Final = ("amcl", "move_base")


def _remedy(paths: Iterable[ParameterPath]) -> str:
    """Return a remedy for a file that has the parameters of a node below another name."""
    for path in paths:
        for node in _SECTIONS:
            if node in path[1:-1]:
                index = max(i for i, part in enumerate(path[:-1]) if part == node)
                extra, name = "/".join(path[:index]), "/".join(path[index:])
                return (
                    f"write {name}: remove {extra} from the file or from its namespace "
                    '("/" for the root)'
                )
    return "load it into the namespace of the node that reads it, see files"


_OF_FILES: Final = frozenset(("sut", "about", "like", "kind", "ros", "files", "parameters"))


def _changes(overrides: Sequence[Override], layer: SutLayer) -> ParameterValues:
    """Return overrides as parameters of a layer: dots and slashes lead into namespaces."""
    settings = layer.settings
    changes: ParameterValues = {}
    for override in overrides:
        path = _parameter_path(override.key, settings)
        if path[0] in _OF_FILES and not any(other[0] == path[0] for other in settings):
            message = f'"{path[0]}" is not a parameter'
            hint = "write a file of its own: suts/NAME.yaml with like: this one"
            if path[0] == "parameters" and len(path) > 1:
                hint = f"write {'.'.join(path[1:])} alone"
            raise InputError.at(override.where, message, hint)
        before = settings.get(path)
        value = override.value
        if layer.kind.plain_numbers and not (before and isinstance(before.value, str)):
            value = _plain(value)
        changes[path] = ParameterValue(value, override.where)
    return changes


def _parameter_path(key: str, settings: ParameterValues) -> ParameterPath:
    """Return the path of a dotted or slashed key; existing names may contain dots."""
    paths, rest = list(settings), key.strip("/")
    path: ParameterPath = ()
    while rest:
        names = dict.fromkeys(p[len(path)] for p in paths if len(p) > len(path))
        name, rest = split_key(names, rest, "./")
        path = (*path, name)
        paths = [p for p in paths if p[: len(path)] == path]
    return path or (key,)


_QUANTITY: Final = re.compile(r"\s*[+-]?(?:\d|\.\d)")


def _plain(value: Any) -> Any:
    """Return a quantity with a unit as a number in SI units; keep any other value."""
    if not isinstance(value, str) or not _QUANTITY.match(value):
        return value
    try:
        return read_quantity(value).value
    except ValueError:
        return value  # text that begins with a digit, which the kind checks


def _diagnostics(
    error: ValueError, document: YamlDocument, settings: ParameterValues
) -> list[Finding]:
    """Return the findings of an error, each at the place of its value."""
    if isinstance(error, ParameterError):
        place = partial(_placed, document=document, settings=settings)
        return list(dict.fromkeys(map(place, error.problems)))
    # A plain ValueError has no path: the best guess is the first parameter that it names.
    message = str(error)
    where = _named_place(message, settings)
    if where is not None:
        return [Finding(where, message)]
    key = next((key for key in ("parameters", "kind", "like") if key in document.data), "sut")
    return [Finding(document.where((key,)), message)]


def _named_place(message: str, settings: ParameterValues) -> Where | None:
    """Return the place of the first parameter that a message names."""
    for path, setting in settings.items():
        if f'"{path[0]}"' in message or message.startswith(f"{path[0]}:"):
            return setting.where
    return None


def _idle_warning(
    findings: ParameterFindings, layer: SutLayer, settings: ParameterValues
) -> tuple[Finding, ...]:
    """Return the warning that names values without effect, if any."""
    # A common value of both costmaps is one line of a file, so it is named once.
    idle = {
        parameter_place(settings, finding.path): "/".join(map(str, finding.path[-2:]))
        for finding in findings.without_effect
    }
    if not idle:
        return ()
    message = f"without effect here: {first_words(idle.values(), _MOST_NAMED)}"
    hint = f"scenario sut show {shlex.quote(layer.document.file)} says why" if layer.files else ""
    return (Finding(layer.document.where(("sut",)), message, hint, Severity.WARNING),)


def _placed(
    finding: ParameterFinding,
    document: YamlDocument,
    settings: ParameterValues,
    severity: Severity = Severity.ERROR,
) -> Finding:
    where = parameter_place(settings, finding.path)
    if where is None:
        # The path is of a key that is not a parameter, such as a file's name.
        is_key = finding.path and finding.path[0] in document.data
        where = document.where(finding.path if is_key else ("sut",))
    return Finding(where, _named(finding), finding.hint, severity)


def _named(finding: ParameterFinding) -> str:
    """Return the message with the name of its value in front, unless it contains it."""
    names = [part for part in finding.path if isinstance(part, str)]
    name = names[-1] if names else ""
    if not name or finding.message.startswith(name) or f'"{name}"' in finding.message:
        return finding.message
    indices = "".join(f"[{part}]" for part in finding.path if isinstance(part, int))
    return f"{name}{indices}: {finding.message}"
