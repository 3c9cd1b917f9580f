"""The key ``ros`` of a SUT file: a folder of parameter files, or launch files and what they need.

A file that is like another may say only what differs, such as another arg: the launch files are
then read again with it.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, Final, TypeAlias

from pydantic import BeforeValidator, Field

from grammars.text.diagnostics import Diagnostic, InputError, Where
from grammars.text.documents import ONE_OR_MORE, StrictModel, YamlDocument

if TYPE_CHECKING:
    from grammars.roslaunch import LaunchSettings


def _as_text(value: Any) -> Any:
    """Return a number or truth value as launch files write it."""
    if isinstance(value, bool):
        return str(value).lower()
    return str(value) if isinstance(value, int | float) else value


_Texts: TypeAlias = Annotated[list[Annotated[str, Field(min_length=1)]], ONE_OR_MORE]
_Text: TypeAlias = Annotated[
    str, BeforeValidator(_as_text, json_schema_input_type=str | bool | int | float)
]


class RosSource(StrictModel):
    """Where the configuration of a robot is: its launch files, read as roslaunch reads them."""

    folder: str | None = Field(default=None, min_length=1)
    """A folder with the parameter files of a robot's navigation package (amcl.yaml,
    costmap_common_params.yaml, move_base_params.yaml ...), loaded as usual launch files do.
    "ros: FOLDER" is the same."""
    launch: _Texts = Field(default_factory=list)
    """Launch files (XML) that start move_base and amcl, one after the other."""
    args: dict[str, _Text] = Field(default_factory=dict)
    """Args for the launch files, as on the command line of roslaunch."""
    packages: _Texts = Field(default_factory=list)
    """Folders that are packages or hold some, for $(find PACKAGE). The packages that the launch
    files are in need not be named."""
    env: dict[str, _Text] = Field(default_factory=dict)
    """Environment variables for $(env NAME) and $(optenv NAME); the shell's are not looked at."""
    skip: _Texts = Field(default_factory=list)
    """Endings of files that the launch files load or include and that are left out."""
    node: str | None = Field(default=None, pattern=r"^/?[A-Za-z][A-Za-z0-9_/]*$")
    """The full name of the move_base to test, where the launch files start several."""


def as_ros_source(value: Any) -> Any:
    """Take a text for a folder."""
    return {"folder": value} if isinstance(value, str) else value


_LAUNCH_KEYS: Final = ("args", "packages", "env", "skip", "node")


@dataclass(frozen=True, slots=True)
class LaunchChange:
    """What one SUT file says about launch files; paths in it are relative to ``folder``."""

    said: RosSource
    document: YamlDocument
    folder: Path

    def where(self, *path: str | int) -> Where:
        """Return where something below ``ros`` stands."""
        return self.document.where(("ros", *path))


def is_change(source: RosSource) -> bool:
    """Whether a key ``ros`` names nothing of its own and changes that of another file."""
    return not source.folder and not source.launch


def check_source(source: RosSource, where: Callable[..., Where]) -> None:
    """Raise :class:`InputError` for keys that do not go together."""
    if not source.folder:
        if is_change(source) and not any(getattr(source, key) for key in _LAUNCH_KEYS):
            message = "ros: names neither a folder nor launch files"
            raise InputError.at(where(), message, 'write "launch: FILE", or a folder')
        return
    for key in ("launch", *_LAUNCH_KEYS):
        if getattr(source, key):
            message = f"{key}: a folder is read without launch files"
            raise InputError.at(where(key), message, "write folder or launch, not both")


@dataclass(frozen=True, slots=True)
class LaunchPlan:
    """The launch files to be read and all that SUT files say about them."""

    files: tuple[tuple[Path, Where], ...]
    settings: LaunchSettings
    node: str | None
    node_where: Where
    where: Where


@dataclass(slots=True)
class _Gathered:
    """What several files say, each with its place."""

    places: dict[tuple[str | int, ...], Where] = field(default_factory=dict)
    args: dict[str, str] = field(default_factory=dict)
    env: dict[str, str] = field(default_factory=dict)
    packages: list[Path] = field(default_factory=list)
    skip: list[str] = field(default_factory=list)

    def take(self, change: LaunchChange) -> None:
        """Add what a file says; its packages come before those of files below it."""
        said = change.said
        for key, own in (("args", self.args), ("env", self.env)):
            given: Mapping[str, str] = getattr(said, key)
            own.update(given)
            self.places |= {(key, name): change.where(key, name) for name in given}
        self.skip += [ending for ending in said.skip if ending not in self.skip]
        for index, ending in enumerate(said.skip):
            self.places[("skip", self.skip.index(ending))] = change.where("skip", index)
        own_packages = [change.folder / name for name in said.packages]
        named = [(path, self.places[("packages", i)]) for i, path in enumerate(self.packages)]
        named = [(p, change.where("packages", i)) for i, p in enumerate(own_packages)] + named
        self.packages = [path for path, _ in named]
        self.places |= {("packages", i): where for i, (_, where) in enumerate(named)}


def plan_launch(base: LaunchChange, changes: tuple[LaunchChange, ...]) -> LaunchPlan:
    """Return what to read: the launch files of ``base`` with ``changes``, the lowest first."""
    gathered = _Gathered()
    node, node_where = None, base.where()
    for change in (base, *changes):
        gathered.take(change)
        if change.said.node is not None:
            node, node_where = "/" + change.said.node.strip("/"), change.where("node")
    places = gathered.places

    def where(path: tuple[str | int, ...]) -> Where:
        return places.get(path, base.where())

    # What reads launch files is loaded by systems that have some.
    from grammars.roslaunch import LaunchSettings

    return LaunchPlan(
        files=tuple(
            (base.folder / name, base.where("launch", index))
            for index, name in enumerate(base.said.launch)
        ),
        settings=LaunchSettings(
            where, gathered.args, tuple(gathered.packages), gathered.env, tuple(gathered.skip)
        ),
        node=node,
        node_where=node_where,
        where=base.where("launch"),
    )


def refuse_lone_changes(changes: tuple[LaunchChange, ...]) -> None:
    """Refuse what is said about launch files where no file below names any."""
    if changes:
        raise InputError(
            Diagnostic(
                change.where(),
                "ros: there are no launch files to change, here or in what this is like",
                'write "launch: FILE" or a folder',
            )
            for change in changes
        )
