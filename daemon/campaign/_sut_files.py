"""Files that describe systems under test: layers on each other and on ROS parameter files.

Values of a file win over those of its ROS files, and both over the system that it is ``like``. The
result is one tree of parameters; every finding about it has the place of its value. For a ROS 2
stack the tree holds the keys at the top of the file, as written.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Annotated, Any, ClassVar, TypeAlias

from pydantic import BeforeValidator, Field, field_validator

from daemon.campaign._parameter_files import (
    LaunchChange,
    ParameterValues,
    RosSource,
    as_ros_source,
    check_source,
    flatten_parameters,
    load_package_folder,
    load_parameter_files,
    merge_parameters,
    refuse_lone_changes,
    spread_common,
)
from daemon.campaign._scenarios import MOST_LIKE, LayerReference
from daemon.model.attachments import SutMissing
from daemon.stacks.kind import StackKind
from daemon.stacks.registry import stack_kind
from daemon.stacks.ros2 import ROS2
from daemon.stacks.ros2.keys import Ros2Keys, default_for_null
from grammars.model.misplaced_keys import CAMPAIGN_KEYS, MISSION_KEYS, ROBOT_KEYS
from grammars.text.diagnostics import Finding, InputError, Where
from grammars.text.documents import ONE_OR_MORE, RemovedKey, YamlDocument, load_yaml, read_model
from grammars.text.sources import is_file

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
    into both costmaps. For "kind: ros2" and plug-in kinds: files that it needs, one for each name
    of your choice; they travel to the workers."""
    parameters: dict[str, Any] = Field(default_factory=dict)
    """Values that differ from the files, from the base system and from the defaults of the kind.
    null removes an inherited value. Not for "kind: ros2", which has keys of its own."""


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
    above: tuple[Path, ...] = (),
    changes: tuple[LaunchChange, ...] = (),
) -> SutLayer:
    """Read a SUT file and its bases; ``changes`` to its launch files come from ``above``.

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
    base = _base(path, document, text, find, above, below)
    kind = _kind(document, text, base)
    _refuse_keys_of_others(document, text, kind)
    layer = replace(base or SutLayer(text, document, kind), text=text, document=document)
    warnings = list(layer.warnings)
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
    return read_sut(other, find, chain, changes)


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
