"""Files that describe systems under test: layers on each other and on ROS parameter files.

What a file says holds over what its ROS files say, and both over the system it is ``like``. The
outcome is one tree of parameters; every complaint about it stands where the value was written. For
a ROS 2 stack the tree are its keys at the top of the file, as they were written.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Annotated, Any, ClassVar, TypeAlias

from pydantic import BeforeValidator, Field, field_validator

from daemon.campaign._parameter_files import (
    load_package_folder,
    load_parameter_files,
    spread_common,
)
from daemon.campaign._parameters import (
    ParameterValues,
    flatten_parameters,
    merge_parameters,
)
from daemon.campaign._ros_sources import (
    LaunchChange,
    RosSource,
    as_ros_source,
    check_source,
    refuse_lone_changes,
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
"""Finds the SUT file a reference in a file of a folder names; raises :class:`InputError`."""


class SutFile(Ros2Keys):
    """The keys of a file that describes a system under test."""

    elsewhere: ClassVar[Mapping[str, str | RemovedKey]] = {
        **Ros2Keys.elsewhere,
        **ROBOT_KEYS,
        **MISSION_KEYS,
        **CAMPAIGN_KEYS,
        "": 'what differs from the defaults of its kind stands under "parameters:"',
    }
    _null = field_validator(*Ros2Keys.model_fields, mode="before")(default_for_null)

    sut: str = Field(pattern=r"^[A-Za-z0-9][A-Za-z0-9._-]{0,59}$", examples=["my-stack"])
    """Name of this system under test, as verdicts show it."""
    about: str = ""
    """One line for people."""
    like: str | None = None
    """Another system under test: this one is the same except for what is written here."""
    kind: str | None = None
    """What is run: a kind that ships here, or one plugged in as "scenario.suts"."""
    ros: Annotated[
        RosSource | None,
        BeforeValidator(as_ros_source, json_schema_input_type=str | RosSource | None),
    ] = None
    """The configuration of a robot as it is: its launch files, or a folder with the parameter
    files of its navigation package."""
    files: dict[str, Annotated[list[str], ONE_OR_MORE]] = Field(default_factory=dict)
    """ROS parameter files by the namespace they are loaded into, such as move_base/global_costmap;
    costmap_common is loaded into both costmaps. For "kind: ros2" and a kind plugged in: files it
    needs, one each by a name of your choice; they travel to the workers."""
    parameters: dict[str, Any] = Field(default_factory=dict)
    """What differs from the files, from the system this one is like, from the defaults of the
    kind. null takes an inherited value away. Not for "kind: ros2", which has keys of its own."""


@dataclass(frozen=True, slots=True)
class SutLayer:
    """A SUT file with everything below it, before its values are checked.

    ``files`` are the SUT files it is made of, itself first. ``attached`` are the files that travel
    to the workers. ``parameter_files`` are those of ROS that people named, or that were found in a
    folder they named. ``launched`` says whether there are launch files below.
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
        """Return the layer with other values.

        Raises :class:`InputError` for a ``null`` without an inherited value.
        """
        if self.launched:
            changes = spread_common(changes, self.settings)
        return replace(self, settings=merge_parameters(self.settings, changes))


def kind_layer(kind: str, where: Where) -> SutLayer:
    """Return a system that is called by its kind at ``where``: an empty file.

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
    """Read a SUT file and all it stands on; ``changes`` to its launch files come from ``above``.

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
        # What reads launch files is loaded by systems that have some.
        from daemon.campaign._launch import load_launched

        started = load_launched(ros, changes, warnings)
        settings = merge_parameters(layer.settings, started)
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
    for values in (*loaded, _written(document, text, kind)):
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
    """Return the files that travel, by name."""
    attached: dict[str, Path] = {}
    for name, places in files.items():
        if len(places) != 1:
            where = document.where(("files", name))
            raise InputError(Finding(where, f"{name}: is one file, not several"))
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
    """Return the layer this one is ``like``."""
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
        raise InputError(Finding(where, message, "be like one nearer to the first"))
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
    """Refuse keys at the top of a file that mean nothing for its kind."""
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


def _written(document: YamlDocument, text: SutFile, kind: StackKind[Any]) -> ParameterValues:
    if kind.keys:
        keys = {key: document.data[key] for key in kind.keys if key in document.data}
        return flatten_parameters(keys, document.where)
    return flatten_parameters(text.parameters, lambda p: document.where(("parameters", *p)))
