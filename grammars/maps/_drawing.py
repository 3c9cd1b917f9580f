"""Map drawn from a DXF drawing: the lines on chosen layers, for the importer of maps.

The importer finds walls, rooms and doorways in it, as in the map of a robot.
"""

from __future__ import annotations

import logging
import math
from collections import Counter
from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from fnmatch import fnmatch
from pathlib import Path
from typing import TYPE_CHECKING, Any, Final

import numpy as np

from grammars.model.grid import FREE, OCCUPIED, UNKNOWN, OccupancyGrid
from grammars.text.diagnostics import Diagnostic, InputError, Severity, Where
from grammars.text.extras import load_extra
from grammars.text.sources import refuse_unreadable
from grammars.text.terminal_text import printable

if TYPE_CHECKING:
    from grammars.maps._drawn_walls import Line

WALL_LAYERS: Final = ("*wall*", "*wand*", "*waende*", "*wände*", "*mur*", "*pared*")
"""Names of layers that hold walls, unless others are named."""
UNITS: Final = {"mm": 1e-3, "cm": 1e-2, "dm": 1e-1, "m": 1.0, "in": 0.0254, "ft": 0.3048}
"""Units of drawings in metres."""
_UNIT_CODES: Final = {1: "in", 2: "ft", 4: "mm", 5: "cm", 6: "m", 14: "dm"}
"""Codes of $INSUNITS (DXF reference, HEADER section)."""
_LINES: Final = ("LINE", "LWPOLYLINE", "POLYLINE", "ARC", "CIRCLE", "ELLIPSE", "SPLINE")
_CELL, _MOST_CELLS = 0.02, 4e6
"""Side of a cell [m]; buildings that would have more cells have larger ones."""
_MARGIN: Final = 3.0
"""Empty floor around the building [m]: more than half of the widest gate."""
_LARGEST_FILE, _MOST_ENTITIES, _DEEPEST_BLOCK = 256 * 1024 * 1024, 500_000, 8
_SIZES, _FAR = (1.0, 2000.0), 1000.0
"""Extents of a building [m]; one farther from the origin than ``_FAR`` is moved there."""


@dataclass(frozen=True, slots=True)
class DrawingSettings:
    """Choices for reading a drawing; ``layers`` are patterns with ``*`` and ``?``.

    ``unit`` is a key of ``UNITS``, or empty for the unit that the file names. Walls drawn as one
    line become ``thickness`` [m] thick.
    """

    layers: tuple[str, ...] = WALL_LAYERS
    unit: str = ""
    thickness: float = 0.1


@dataclass(frozen=True, slots=True)
class DrawnMap:
    """Map of a drawing, and warnings about it."""

    grid: OccupancyGrid
    warnings: tuple[Diagnostic, ...]


def draw_map(path: Path, settings: DrawingSettings) -> DrawnMap:
    """Return the map that the walls in the model space of a DXF file make.

    Raises :class:`InputError` for a file that is no DXF, layers without lines, an unknown unit or
    size, and walls that enclose nothing; ``MissingExtraError`` without the extra ``import``.
    """
    # With scipy, which campaigns that read a walls layer do without.
    from grammars.maps._drawn_walls import paint_lines, walls_and_rooms

    where, others = Where(str(path)), Counter[str]()
    document = _open(path, where)
    unit = settings.unit or _UNIT_CODES.get(document.header.get("$INSUNITS", 0), "")
    if unit not in UNITS:
        problem = f'"{unit}" is no unit of drawings' if unit else "the drawing names no known unit"
        raise InputError.at(where, problem, f"give its unit with --unit: {', '.join(UNITS)}")
    lines = list(_wall_lines(document, settings, UNITS[unit], where, others))
    if not lines:
        hint = f"choose one with --layer: {_listed(others)}" if others else "it holds no lines"
        names = ", ".join(settings.layers)
        raise InputError.at(where, f"no layer with lines is named like {names}", hint)
    corners = np.concatenate(lines)
    low, high = corners.min(axis=0), corners.max(axis=0)
    if not _SIZES[0] <= max(high - low) <= _SIZES[1]:
        x, y = (high - low).tolist()
        problem = f"the walls measure {x:,.3g} m by {y:,.3g} m, which is no building"
        raise InputError.at(where, problem, f"the unit was {unit}; give the true one with --unit")
    warnings = []
    shift = np.floor(low) if math.hypot(*low) > _FAR else np.zeros(2)
    if shift.any():
        x, y = (-shift).tolist()
        warnings.append(f"the building was moved by ({x:.0f} m, {y:.0f} m), near the origin")
    if others:
        warnings.append(f"lines on other layers were ignored: {_listed(others)}")
    width, depth = (high - low + 2 * _MARGIN).tolist()
    cell = max(_CELL, math.sqrt(width * depth / _MOST_CELLS))
    origin = np.floor((low - shift - _MARGIN) / cell) * cell
    shape = (math.ceil(depth / cell) + 2, math.ceil(width / cell) + 2)
    painted = paint_lines([(line - shift - origin) / cell for line in lines], shape, cell)
    walls, rooms = walls_and_rooms(painted, cell, settings.thickness)
    if not rooms.any():
        hint = "close the gaps in the drawing, or add the layer that closes them with --layer"
        raise InputError.at(where, "the walls enclose no room", hint)
    cells = np.where(walls, OCCUPIED, np.where(rooms, FREE, UNKNOWN)).astype(np.int8)
    x, y = origin.tolist()
    found = tuple(Diagnostic(where, text, "", Severity.WARNING) for text in warnings)
    return DrawnMap(OccupancyGrid(cell, x, y, cells), found)


def _open(path: Path, where: Where) -> Any:
    refuse_unreadable(path, "the drawing", _LARGEST_FILE)
    try:
        with path.open("rb") as opened:
            head = opened.read(6)
    except OSError as error:
        raise InputError.at(where, f"cannot be read: {error.strerror}") from error
    if head[:2] == b"AC" and head[2:].isdigit():
        hint = "save it as DXF in your CAD, or convert it with the ODA File Converter or dwg2dxf"
        raise InputError.at(where, "is a DWG file, which only AutoCAD's own library reads", hint)
    if not head:
        raise InputError.at(where, "is empty")
    ezdxf = load_extra("ezdxf", "import", "a drawing", "import")
    recover = load_extra("ezdxf.recover", "import", "a drawing", "import")
    # Its log reports mended details, which do not matter to readers.
    logging.getLogger("ezdxf").addHandler(logging.NullHandler())
    try:
        document, _ = recover.readfile(str(path))
    except (ezdxf.DXFError, OSError, ValueError, LookupError, TypeError, AttributeError) as error:
        # Broken files end the loader in many ways, with words for programmers.
        reason = printable(next(iter(str(error).splitlines()), type(error).__name__))
        hint = "it is no DXF, or damaged: save it again as DXF, version 2010 or later"
        raise InputError.at(where, f"cannot be read as a DXF drawing: {reason}", hint) from error
    return document


def _wall_lines(
    document: Any, settings: DrawingSettings, scale: float, where: Where, others: Counter[str]
) -> Iterator[Line]:
    """Yield the lines on layers of walls [m]; ``others`` counts the lines on other layers."""
    from ezdxf.lldxf.const import DXFError
    from ezdxf.path import make_path

    try:
        for number, (entity, layer) in enumerate(_entities(document.modelspace(), "0", 0)):
            if number == _MOST_ENTITIES:
                problem = f"holds more than {_MOST_ENTITIES:,} entities, blocks in blocks counted"
                raise InputError.at(where, problem, "save the plan of one storey alone")
            if entity.dxftype() not in _LINES:
                continue
            if not any(fnmatch(layer.lower(), name.lower()) for name in settings.layers):
                others[layer] += 1
                continue
            path = make_path(entity).flattening(_CELL / 4 / scale)
            line = np.array([(p.x * scale, p.y * scale) for p in path], dtype=np.float64)
            if len(line) > 1 and np.isfinite(line).all():
                yield line
    except (DXFError, TypeError, ValueError) as error:
        problem = "holds entities that cannot be read: the file is damaged"
        raise InputError.at(where, problem, "save it again as DXF") from error


def _entities(entities: Iterable[Any], layer: str, depth: int) -> Iterator[tuple[Any, str]]:
    """Yield entities with their layers; layer 0 of a block is the layer of its insertion."""
    for entity in entities:
        own = printable(entity.dxf.get("layer", "0"))
        on = layer if own == "0" and depth else own
        if entity.dxftype() != "INSERT":
            yield entity, on
        elif depth < _DEEPEST_BLOCK:
            for single in entity.multi_insert() if entity.mcount > 1 else (entity,):
                yield from _entities(single.virtual_entities(), on, depth + 1)


def _listed(layers: Counter[str]) -> str:
    return ", ".join(f"{name} ({count:,})" for name, count in layers.most_common(6))
