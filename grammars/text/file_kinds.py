"""Kinds of files that people give in place of others, told apart by their content.

A message about a wrong file names its kind and the way to use it.
"""

from __future__ import annotations

import re
from collections.abc import Iterable
from contextlib import suppress
from pathlib import Path
from typing import Final, NamedTuple

from grammars.text.diagnostics import InputError, Where

HEAD: Final = 4096
"""Bytes of a file that tell its kind."""
_XML: Final = rb"(?:<[?!][^>]*>\s*)*<"
_RECORDING: Final = "recordings of robots are not read: `scenario run` records traces, .mcap files"
_PICTURE: Final = (
    "of a map, name its YAML file; else make a building: scenario import FILE --resolution 0.05"
)
_DRAWING: Final = "`scenario import` makes a building of a drawing saved as DXF"


class FileKind(NamedTuple):
    """A kind of file for messages: ``a picture``, and what to do with it."""

    title: str
    advice: str


_MAGIC: Final = {
    rb"#ROSBAG": FileKind("a bag of ROS 1", _RECORDING),
    rb"SQLite format 3": FileKind("a database, such as a bag of ROS 2", _RECORDING),
    rb"\x89MCAP": FileKind("a recording (MCAP)", "`scenario show` and `judge` read traces of runs"),
    rb"\x89PNG|\xff\xd8\xff|BM.{4}\0{4}|P[1-6]\s": FileKind("a picture", _PICTURE),
    rb"GIF8|II\*\0|MM\0\*|RIFF.{4}WEBP": FileKind("GIF, TIFF or WebP", "save it as PNG"),
    rb"(999\r?\n[^\n]*\n)*\s*0\s+SECTION\s|AutoCAD Binary": FileKind("a DXF drawing", _DRAWING),
    rb"ISO-10303-21": FileKind("an IFC model", _DRAWING),
    rb"AC10": FileKind("a DWG drawing", _DRAWING),
    rb"%PDF": FileKind("a PDF file", _DRAWING),
    rb"PK\x03\x04|\x1f\x8b|BZh|\x28\xb5\x2f\xfd": FileKind("compressed", "unpack it first"),
    rb"version https://git-lfs": FileKind("a placeholder of Git LFS", "fetch it: git lfs pull"),
    _XML + rb"(?:sdf|gazebo)\b": FileKind("a model of Gazebo", "import a map made in it"),
    _XML + rb"robot\b": FileKind("a URDF model", "write the robot's size in robots/NAME.yaml"),
    _XML + rb"launch\b": FileKind("a launch file", "a system under test names it: launch: FILE"),
    rb"<(?!<)": FileKind("an XML or HTML file", ""),
}
"""Kinds by patterns of the first bytes."""
_KEYS: Final[dict[tuple[str, ...], FileKind]] = {
    ("campaign", "scenarios"): FileKind("a campaign", "run it: scenario run FILE"),
    ("robot", "footprint"): FileKind("a robot", "a campaign names it: robot: NAME"),
    ("sut", "kind"): FileKind("a system under test", "a campaign names it: matrix: {sut: [NAME]}"),
    ("sut", "like"): FileKind("a system under test", "a campaign names it: matrix: {sut: [NAME]}"),
    ("waypoints",): FileKind("a mission", "a campaign names it: mission: NAME"),
    ("walls", "spaces"): FileKind("a walls layer", "a campaign names it: floorplan: NAME"),
    ("image", "resolution"): FileKind(
        "a map", "`scenario import` makes a building of it; campaigns name it as map: {file: FILE}"
    ),
    **{
        (node,): FileKind("a parameter file of ROS", "the file of a system under test names it")
        for node in ("amcl", "move_base", "controller_server", "bt_navigator")
    },
    ("levels",): FileKind(
        "a building of Open-RMF", "import the picture it is drawn on, or draw its walls as DXF"
    ),
}
_ENDINGS: Final = {
    ".fpm": FileKind("a floor plan", "a campaign names it: floorplan: NAME"),
    ".scenery": FileKind("a scenery layer", "a campaign names it: objects: NAME"),
    ".variation": FileKind("a variation", "a campaign names it: vary: {floorplan: NAME}"),
    ".oracles.yaml": FileKind("a file of oracles", "a campaign names it: oracles: NAME"),
}


def kind_of_name(name: str) -> FileKind | None:
    """Return the kind of a layer by the ending of its name."""
    return next((kind for end, kind in _ENDINGS.items() if name.endswith(end)), None)


def kind_of_content(head: bytes) -> FileKind | None:
    """Return the kind of a file that begins with ``head``, unless it may be text of ours."""
    head = head[:HEAD].removeprefix(b"\xef\xbb\xbf").lstrip()
    return next((kind for magic, kind in _MAGIC.items() if re.match(magic, head, re.DOTALL)), None)


def kind_of_keys(keys: Iterable[str], known: Iterable[str] = ()) -> FileKind | None:
    """Return the kind of a YAML file with these top keys, unless they are ``known`` ones."""
    own = next((own for own in _KEYS if {*keys} >= {*own}), None)
    return None if own is None or {*known} >= {*own} else _KEYS[own]


def kind_of_file(path: Path) -> FileKind | None:
    """Return the kind of a file, ``None`` if it is unknown or cannot be read."""
    with suppress(OSError, ValueError):
        # A pipe may have no end.
        if path.is_file():
            with path.open("rb") as file:
                head = file.read(HEAD)
            keys = re.findall(r"^(\w+):", head.decode("utf-8", "replace"), re.MULTILINE)
            return kind_of_content(head) or kind_of_keys(keys)
    return None


def refuse_kind(kind: FileKind | None, where: Where, name: str = "") -> None:
    """Raise :class:`InputError` at ``where`` for a file of a well-known kind."""
    if kind is not None:
        raise InputError.at(where, f"{name} is {kind.title}".lstrip(), kind.advice)
