"""The key ``ros`` of a SUT file: a folder of parameter files, or launch files with settings.

A file that is like another may contain only differences, such as another arg: the launch files are
then read again with it.
"""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Any, Final, TypeAlias

from pydantic import Field

from grammars.text.diagnostics import Finding, InputError, Where
from grammars.text.documents import ONE_OR_MORE, StrictModel, YamlDocument, text_or

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
    """Folders that are or contain packages, for $(find PACKAGE). The packages of the launch files
    themselves need not be named."""
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
