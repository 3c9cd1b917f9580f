"""Map of a DXF drawing: the lines on its wall layers, painted for the importer of maps.

Two lines enclose a wall; a single line is the middle of a wall. The importer finds rooms and
doorways in the map, as in a robot's map. ezdxf renders the drawing. Only the import command loads
this module, because it needs the libraries of the extra ``cad``.
"""

from __future__ import annotations

import math
import re
import struct
from collections import Counter, defaultdict
from collections.abc import Iterable, Iterator, Mapping, Sequence
from fnmatch import fnmatch
from pathlib import Path
from typing import Any, Final, TypeAlias

import numpy as np
import numpy.typing as npt
from ezdxf import recover
from ezdxf.addons.drawing.config import Configuration, HatchPolicy, LinePolicy
from ezdxf.addons.drawing.frontend import Frontend
from ezdxf.addons.drawing.properties import RenderContext
from ezdxf.addons.drawing.recorder import PathRecord, Player, PointsRecord, Recorder
from ezdxf.filemanagement import readfile
from ezdxf.lldxf.const import DXFError
from PIL import Image, ImageDraw
from scipy import ndimage
from scipy.spatial import KDTree

from grammars.model.grid import FREE, OCCUPIED, UNKNOWN, OccupancyGrid
from grammars.text.diagnostics import Findings, InputError, Where
from grammars.text.sources import refuse_unreadable

Line: TypeAlias = npt.NDArray[np.float64]
"""Corners of a line, shape (corners, 2)."""
Cells: TypeAlias = npt.NDArray[np.bool_]
"""Cells of a map, shape (rows, columns)."""

WALL_LAYERS: Final = ("*wall*", "*wand*", "*waende*", "*wände*", "*mur*", "*pared*")
"""Default names of layers that hold walls."""
_UNITS: Final = {"mm": 1e-3, "cm": 1e-2, "dm": 1e-1, "m": 1.0, "in": 0.0254, "ft": 0.3048}
"""Units of drawings [m]."""
_UNIT_CODES: Final = {1: "in", 2: "ft", 4: "mm", 5: "cm", 6: "m", 14: "dm"}
"""Codes of $INSUNITS (DXF reference, HEADER section)."""
_REMARKS: Final = re.compile("DIMENSION|LEADER|TEXT|ATT|RAY|XLINE|IMAGE|OLE|TOLERANCE")
"""Entities that explain a drawing and do not belong to the building."""
_DAMAGED: Final = (
    *(ArithmeticError, AttributeError, LookupError, RecursionError, TypeError, ValueError),
    *(DXFError, OSError, struct.error),
)
"""Errors that ezdxf raises for broken files."""
_CELL, _MOST_CELLS, _MARGIN = 0.02, 4e6, 3.0
"""Side of a cell [m], larger in large buildings; margin around them [m], at least half a gate."""
_LARGEST_FILE, _MOST_ENTITIES = 256 * 1024 * 1024, 500_000
_SIZES, _LARGE, _FAR = (1.0, 2000.0), 200.0, 1000.0
"""Extents of buildings and of doubtful ones [m]; beyond ``_FAR`` from the origin they are moved."""
_MOST_JAMBS: Final = 8
"""Number of nearest ends of lines with which an end is joined."""
_THICKEST: Final = 0.6
"""Distance [m] beyond which two lines are two walls."""
_GATES: Final = (1.3, 2.5, 5.0)
"""Widths of openings in the outer wall [m] that bound the building: doors, gates of halls."""


def draw_map(
    path: Path,
    layers: Sequence[str],
    standing: Sequence[str],
    unit: str,
    thickness: float,
    findings: Findings,
) -> OccupancyGrid:
    """Return the map of the model space of a DXF file; add warnings to ``findings``.

    ``layers`` are patterns with ``*`` and ``?`` for layers of walls, ``standing`` those for layers
    of other fixed things. An empty ``unit`` means that of the file. Walls drawn as one line become
    ``thickness`` [m] thick.

    Raises :class:`InputError` for a file that is not DXF, layers without lines, an unknown unit,
    an implausible size, and walls that enclose no room.
    """
    where = Where(str(path))
    code, player = _shown(path, where, findings)
    unit, is_of_file = unit.lower() or _UNIT_CODES.get(code, ""), not unit
    if unit not in _UNITS:
        problem = f'unknown unit "{unit}"' if unit else "the drawing names no known unit"
        raise InputError.at(where, problem, f"give its unit with --unit: {', '.join(_UNITS)}")
    lines = _lines_by_layer(player, _UNITS[unit])
    walls, things = _take(lines, layers), _take(lines, standing)
    others = _listed({name: len(on_it) for name, on_it in lines.items()})
    if not walls:
        hint = f"choose one with --layer: {others}" if others else "its model space shows no lines"
        raise InputError.at(where, f"no layer with lines matches {', '.join(layers)}", hint)
    if others:
        findings.warning(where, f"lines on other layers were ignored: {others}")
    low, high = (pick(np.concatenate(walls), axis=0) for pick in (np.min, np.max))
    width, depth = (high - low).tolist()
    if not _SIZES[0] <= max(width, depth) <= _SIZES[1]:
        problem = f"the walls measure {width:,.3g} m by {depth:,.3g} m: not a building"
        raise InputError.at(where, problem, f"the unit was {unit}; give the right one with --unit")
    if is_of_file and max(width, depth) > _LARGE:
        message = f"the walls measure {width:.0f} m by {depth:.0f} m: the file says {unit}"
        findings.warning(where, message, "if it was drawn in another unit, give that with --unit")
    shift = np.floor(low) if math.hypot(*low) > _FAR else np.zeros(2)
    if shift.any():
        x, y = (-shift).tolist()
        message = f"the building was moved by ({x:.0f} m, {y:.0f} m), near the origin"
        findings.warning(where, message)
    cell = max(_CELL, math.sqrt((width + 2 * _MARGIN) * (depth + 2 * _MARGIN) / _MOST_CELLS))
    origin = np.floor((low - _MARGIN) / cell) * cell
    columns, rows = np.ceil((high + _MARGIN - origin) / cell).astype(int).tolist()
    faces = [(line - origin) / cell for line in walls]
    occupied = _walls(_painted([*faces, *_caps(faces, cell)], rows, columns), cell, thickness)
    rooms = _rooms(occupied, cell)
    if (floor := _open_floor(occupied, rooms)) is not None:
        x, y = (floor.mean(axis=0)[::-1] * cell + origin - shift).tolist()
        size = f"{len(floor) * cell**2:.0f} m² around [{x:.1f}, {y:.1f}]"
        hint = f"floor ends at gates up to {_GATES[-1]:g} m: draw lines across wider ones"
        message = f"the largest area, {size}, is open to the outside and was ignored"
        findings.warning(where, message, hint)
    if not rooms.any():
        hint = "close the gaps in the drawing, or add the layer that closes them with --layer"
        raise InputError.at(where, "the walls enclose no room", hint)
    painted = _painted(((line - origin) / cell for line in things), rows, columns)
    cells = np.where(rooms, FREE, UNKNOWN).astype(np.int8)
    cells[occupied | (rooms & ndimage.binary_fill_holes(painted))] = OCCUPIED
    x, y = (origin - shift).tolist()
    return OccupancyGrid(cell, x, y, cells)


def _shown(path: Path, where: Where, findings: Findings) -> tuple[int, Player]:
    """Return the code of a drawing's unit, and the recording of its model space."""
    refuse_unreadable(path, "the drawing", _LARGEST_FILE)
    data = path.read_bytes()
    if b"SECTION" not in data or data.startswith(b"AC1"):
        hint = "save it as DXF in your CAD, or convert a DWG with the ODA File Converter or dwg2dxf"
        raise InputError.at(where, "is not a DXF drawing", hint)
    if b"EOF" not in data[-64:]:
        problem = "is cut off: the mark EOF at its end is missing"
        raise InputError.at(where, problem, "save or convert the drawing again")
    hidden, absent = Counter[str](), Counter[str]()

    def choose(entity: Any, properties: Any) -> None:
        kind, layer = entity.dxftype(), properties.layer
        block = entity.block() if kind == "INSERT" else None
        if not _REMARKS.search(kind):
            if kind == "INSERT" and (block is None or block.block.is_xref):
                absent[entity.dxf.name] += 1
            # A frozen layer hides the blocks inserted on it; a layer that is off does not.
            elif not properties.is_visible or (block and layer.lower() in frozen):
                hidden[layer] += 1
            else:
                return
        properties.is_visible = False

    recorder = Recorder()
    style = Configuration(line_policy=LinePolicy.SOLID, hatch_policy=HatchPolicy.SHOW_OUTLINE)
    try:
        try:
            document = readfile(path)
        except DXFError:
            document, _ = recover.readfile(path)
        if _count(document.modelspace(), {}) > _MOST_ENTITIES:
            problem = f"holds more than {_MOST_ENTITIES:,} entities, blocks in blocks counted"
            raise InputError.at(where, problem, "save the plan of a single storey")
        frozen = {layer.dxf.name.lower() for layer in document.layers if layer.is_frozen()}
        frontend = Frontend(RenderContext(document), recorder, style)
        frontend.push_property_override_function(choose)
        frontend.draw_layout(document.modelspace())
    except _DAMAGED as error:
        reason = next(iter(str(error).splitlines()), type(error).__name__)
        raise InputError.at(where, f"is damaged: {reason}", "save it again as DXF") from error
    if hidden:
        findings.warning(where, f"hidden entities were ignored on layers: {_listed(hidden)}")
    if absent:
        message = f"blocks missing in the file were ignored: {_listed(absent)}"
        findings.warning(where, message, "bind external references to the drawing in your CAD")
    return document.units, recorder.player()


def _count(layout: Any, blocks: dict[str, int]) -> int:
    """Return the number of entities of a layout, including every insertion of its blocks.

    ``blocks`` collects the numbers of blocks by name; a block inside itself counts as too large.
    """
    total = 0
    for entity in layout:
        total += 1
        block = entity.block() if entity.dxftype() == "INSERT" else None
        if block is not None:
            if block.name not in blocks:
                blocks[block.name] = _MOST_ENTITIES
                blocks[block.name] = _count(block, blocks)
            total += entity.mcount * blocks[block.name]
    return total


def _lines_by_layer(player: Player, scale: float) -> dict[str, list[Line]]:
    """Return the lines of a drawing [m] by layer; ``scale`` is its unit [m]."""
    lines: defaultdict[str, list[Line]] = defaultdict(list)
    for record, properties in player.recordings():
        points: list[Any] = []
        if isinstance(record, PathRecord):
            points = list(record.path.flattening(_CELL / 4 / scale))
        elif isinstance(record, PointsRecord):
            points = record.points.vertices()
            points += points[:1] if len(points) > 2 else []
        line = np.array([(point.x, point.y) for point in points]) * scale
        # Drawings contain invisible lines without a length.
        if len(line) and np.ptp(line, axis=0).any():
            lines[properties.layer].append(line)
    return lines


def _take(lines: dict[str, list[Line]], patterns: Sequence[str]) -> list[Line]:
    """Remove the lines on layers that match a pattern, and return them."""
    names = [n for n in lines if any(fnmatch(n.lower(), p.lower()) for p in patterns)]
    return [line for name in names for line in lines.pop(name)]


def _listed(layers: Mapping[str, int]) -> str:
    return ", ".join(f"{name} ({n:,})" for name, n in Counter(layers).most_common(6))


def _painted(lines: Iterable[Line], rows: int, columns: int) -> Cells:
    """Return the cells under lines given in cells."""
    image = Image.new("1", (columns, rows))
    brush = ImageDraw.Draw(image)
    for line in lines:
        brush.line(line.clip(-1, max(rows, columns)).ravel().tolist(), fill=1)
    return np.array(image)


def _caps(lines: Sequence[Line], cell: float) -> Iterator[Line]:
    """Yield lines between near ends, which close walls at their jambs."""
    ends = np.concatenate([line[[0, -1]] for line in lines])
    _, place, uses = np.unique(np.round(ends), axis=0, return_inverse=True, return_counts=True)
    loose = ends[uses[place.ravel()] == 1]
    if len(loose):
        # Few lines end around a jamb; hatching has thousands of ends side by side.
        _, near = KDTree(loose).query(loose, _MOST_JAMBS, distance_upper_bound=_THICKEST / cell)
        for one, other in np.argwhere(near < len(loose)).tolist():
            yield loose[[one, near[one, other]]]


def _walls(painted: Cells, cell: float, thickness: float) -> Cells:
    """Return the cells of walls: areas between lines that are nowhere wider than a wall.

    Other lines become walls ``thickness`` [m] thick.
    """
    faces, _ = ndimage.label(~painted)
    half = ndimage.distance_transform_edt(~painted, sampling=cell)
    filled = ~painted & ~np.isin(faces, np.unique(faces[half > _THICKEST / 2]))
    single = painted & ~ndimage.binary_dilation(filled, np.ones((3, 3)), iterations=2)
    walls: Cells = painted | filled
    if single.any():
        walls |= ndimage.distance_transform_edt(~single, sampling=cell) <= thickness / 2
    return walls


def _rooms(walls: Cells, cell: float) -> Cells:
    """Return the floor cells that a disc as wide as a gate cannot reach from outside.

    Where discs inside and outside of a gate overlap, the nearer side gets the floor: rooms end at
    the line between the jambs.
    """
    clearance = ndimage.distance_transform_edt(~walls, sampling=cell)
    rooms = np.zeros_like(walls)
    for gate in _GATES:
        reach = gate / 2 + cell
        wide, _ = ndimage.label(clearance > reach)
        outer, inner = wide == wide[0, 0], (wide > 0) & (wide != wide[0, 0])
        to_outer = ndimage.distance_transform_edt(~outer, sampling=cell)
        outside = ~walls & (to_outer <= reach)
        if inner.any():
            outside &= to_outer <= ndimage.distance_transform_edt(~inner, sampling=cell)
        rest, _ = ndimage.label(~(walls | outside | rooms))
        # Nooks beside the disc outside are rooms only if a disc fits into them.
        nooks = np.setdiff1d(rest[ndimage.binary_dilation(outside)], rest[inner])
        rooms |= (rest > 0) & ~np.isin(rest, nooks)
    return rooms


def _open_floor(walls: Cells, rooms: Cells) -> npt.NDArray[np.intp] | None:
    """Return the cells of an area larger than all rooms and mostly bounded by walls, if any."""
    cells = np.argwhere(walls)
    low, high = cells.min(axis=0), cells.max(axis=0) + 1
    extent = np.s_[low[0] : high[0], low[1] : high[1]]
    floors, count = ndimage.label(~(walls | rooms)[extent])
    if not count:
        return None
    floor = floors == np.bincount(floors[floors > 0]).argmax()
    along = np.count_nonzero(ndimage.binary_dilation(floor) & walls[extent])
    ends = sum(np.count_nonzero(floor[side]) for side in (0, -1, np.s_[:, 0], np.s_[:, -1]))
    is_open = np.count_nonzero(floor) > np.count_nonzero(rooms) and along > 2 * ends
    return np.argwhere(floor) + low if is_open else None
