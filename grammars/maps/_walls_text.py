"""The text of a walls layer, from a building that was found on a map or a drawing."""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator, Sequence
from typing import Final

from grammars.maps.model import Area, DrawnBuilding
from grammars.model.geometry import Point2, Ring

_DECIMALS: Final = 3
"""Coordinates are written in whole millimetres, where that crosses no lines."""
_FINE_DECIMALS: Final = 6
_LINE: Final = 96
"""Longest line of corners."""


def walls_text(building: DrawnBuilding) -> str:
    """Return the walls layer (YAML) that says what ``building`` is; equal buildings, equal texts.

    Its ``source`` becomes the comment at the top. The height said once is that of most walls.
    """
    return "".join(f"{line}\n" for line in _lines(building))


def _lines(building: DrawnBuilding) -> Iterator[str]:
    yield from (f"# {line}".rstrip() for line in building.source.splitlines())
    heights = [wall.height for wall in building.walls]
    common = max(heights, key=lambda height: (heights.count(height), height), default=2.5)
    yield f"walls: {building.name}"
    yield f"height: {_number(common)} m"
    yield ""
    yield "spaces:"
    for space in building.spaces:
        yield f"  {space.name}:"
        yield from _area(space.area, "    ")
    if building.walls:
        yield ""
        yield "standing:"
    for wall in building.walls:
        first, *rest = _area(wall.area, "    ")
        yield f"  - {first.lstrip()}"
        yield from rest
        if wall.height != common:
            yield f"    height: {_number(wall.height)} m"
    if building.entryways:
        yield ""
        yield "entryways:"
    for door in building.entryways:
        start, end = _corner(door.start, _DECIMALS), _corner(door.end, _DECIMALS)
        sizes = f"depth: {_number(door.depth)} m, height: {_number(door.height)} m"
        yield f"  {door.name}: {{from: {start}, to: {end}, {sizes}}}"


def _area(area: Area, indent: str) -> Iterator[str]:
    decimals = _decimals(area)
    yield from _ring("outline: [", area.outline, decimals, indent)
    if area.holes:
        yield f"{indent}holes:"
    for hole in area.holes:
        yield from _ring("- [", hole, decimals, f"{indent}  ")


def _decimals(area: Area) -> int:
    """Return how finely the corners must be written to keep an area an area."""
    from shapely.geometry import Polygon

    outline, *holes = (
        [_rounded(corner) for corner in ring] for ring in (area.outline, *area.holes)
    )
    return _DECIMALS if Polygon(outline, holes).is_valid else _FINE_DECIMALS


def _rounded(corner: Point2) -> Point2:
    return (round(corner[0], _DECIMALS), round(corner[1], _DECIMALS))


def _ring(head: str, ring: Ring, decimals: int, indent: str) -> Iterator[str]:
    """Yield a list of corners, in as many lines as it takes."""
    lines = list(_packed(ring, decimals, len(indent) + len(head)))
    for number, line in enumerate(lines):
        before = head if number == 0 else " " * len(head)
        after = "]" if number == len(lines) - 1 else ","
        yield f"{indent}{before}{', '.join(line)}{after}"


def _packed(ring: Ring, decimals: int, indent: int) -> Iterator[Sequence[str]]:
    line: list[str] = []
    width = indent
    for corner in _distinct(_corner(point, decimals) for point in ring):
        if line and width + len(corner) + 2 > _LINE:
            yield line
            line, width = [], indent
        line.append(corner)
        width += len(corner) + 2
    yield line


def _distinct(corners: Iterable[str]) -> list[str]:
    """Return the corners without those that are written like the one before."""
    found: list[str] = []
    for corner in corners:
        if not found or corner != found[-1]:
            found.append(corner)
    if len(found) > 1 and found[0] == found[-1]:
        found.pop()
    return found


def _corner(point: Point2, decimals: int) -> str:
    # 0.0 is added against "-0.000".
    x, y = (round(value, decimals) + 0.0 for value in point)
    return f"[{x:.{decimals}f}, {y:.{decimals}f}]"


def _number(value: float) -> str:
    """Return a size in metres, to the millimetre."""
    if not math.isfinite(value):
        raise ValueError(f"{value} is no size")
    return f"{round(value, _DECIMALS):g}"
