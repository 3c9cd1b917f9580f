"""Frames of a floor plan: what is published as ``hall-wall-2-frame`` is ``hall.walls[2]`` here."""

from __future__ import annotations

import re
from typing import Final

from grammars.diagnostics import Where
from grammars.floorplan import WORLD_FRAME
from grammars.scenery.model import FrameName

_WALL: Final = re.compile(r"(?P<space>.+)-wall-(?P<index>\d{1,9})-frame")
_FEATURE: Final = re.compile(r"(?:column|divider)-(?P<name>.+)-frame")
_OPENING: Final = re.compile(r"(?:entryway|window)-(?P<name>.+)-frame")


def frame_name(published: str, where: Where) -> FrameName:
    """Return what the scenery language calls a published frame."""
    if published == WORLD_FRAME:
        return FrameName("world", None, "", where)
    wall = _WALL.fullmatch(published)
    if wall is not None:
        return FrameName(wall["space"], int(wall["index"]), "", where)
    thing = _FEATURE.fullmatch(published) or _OPENING.fullmatch(published)
    name = thing["name"] if thing is not None else published.removesuffix("-frame")
    return FrameName(name, None, "", where)


def is_on_floor(published: str) -> bool:
    """Return whether the origin of a frame is on the floor: that of an opening is in its middle."""
    return _OPENING.fullmatch(published) is None
