"""A building from a DXF drawing: walls by their layers, doors by their blocks, rooms between them.

What lines enclose and is as thin as a wall is a wall; a line by itself is the middle of one. Rooms
are what walls and doorways enclose together. The rest of the drawing is ignored, and said to be.
"""

from __future__ import annotations

import logging
from pathlib import Path
from typing import Any, Final

from grammars.maps._drawing_settings import UNITS, DrawingSettings
from grammars.maps.model import DrawnBuilding
from grammars.text.diagnostics import InputError, Where, did_you_mean
from grammars.text.extras import load_extra
from grammars.text.sources import refuse_unreadable

_UNIT_CODES: Final = {1: "in", 2: "ft", 4: "mm", 5: "cm", 6: "m", 14: "dm"}
"""What $INSUNITS says (DXF reference, HEADER section); 0 says nothing."""
_LARGEST_FILE: Final = 256 * 1024 * 1024


def read_drawing(path: str | Path, settings: DrawingSettings | None = None) -> DrawnBuilding:
    """Return the building that the model space of a DXF file shows; warnings are in it.

    Raises :class:`InputError` for a file that is no DXF, for layers without walls, for a drawing
    whose unit is unknown or makes no building, and when the walls enclose nothing;
    :class:`grammars.text.extras.MissingExtraError` without the extra ``import``.
    """
    chosen = settings or DrawingSettings()
    file = Path(path)
    where = Where(str(path))
    document = _open(file, where)
    unit = _unit(document, chosen, where)
    # With shapely, which campaigns that read a layer and no drawing do without.
    from grammars.maps._drawing_building import DrawingReader

    return DrawingReader(where, chosen, unit).building(document, chosen.name or _name_of(file))


def _open(file: Path, where: Where) -> Any:
    try:
        if file.exists():
            refuse_unreadable(file, "the drawing", _LARGEST_FILE)
        with file.open("rb") as opened:
            head = opened.read(6)
    except OSError as error:
        raise InputError.at(where, f"cannot be read: {error.strerror}") from error
    if head[:2] == b"AC" and head[2:].isdigit():
        raise InputError.at(
            where,
            "is a DWG file, which only AutoCAD's own library reads",
            "save it as DXF in your CAD, or convert it with the ODA File Converter or dwg2dxf",
        )
    if not head:
        raise InputError.at(where, "is empty")
    ezdxf = load_extra("ezdxf", "import", "a drawing", "import")
    recover = load_extra("ezdxf.recover", "import", "a drawing", "import")
    # What it mends in passing is of no use to people who only read.
    logging.getLogger("ezdxf").addHandler(logging.NullHandler())
    try:
        document, _ = recover.readfile(str(file))
    except (ezdxf.DXFError, OSError, ValueError, LookupError, TypeError, AttributeError) as error:
        # The loader meets what is broken in many ways, and says so in words for programmers.
        hint = "it is no DXF, or damaged: save it again as DXF, version 2010 or later"
        reason = next(iter(str(error).splitlines()), type(error).__name__)
        reason = reason.encode("utf-8", "replace").decode("utf-8")
        message = f"cannot be read as a DXF drawing: {reason}"
        raise InputError.at(where, message, hint) from error
    return document


def _unit(document: Any, settings: DrawingSettings, where: Where) -> str:
    known = ", ".join(UNITS)
    if settings.unit:
        if settings.unit not in UNITS:
            hint = did_you_mean(settings.unit, UNITS)
            raise InputError.at(where, f'"{settings.unit}" is no unit of drawings', hint)
        return settings.unit
    code = document.header.get("$INSUNITS", 0)
    if code not in _UNIT_CODES:
        says = "does not say its unit" if not code else f"is in units of kind {code} ($INSUNITS)"
        raise InputError.at(where, f"the drawing {says}", f"say it with --unit: {known}")
    return _UNIT_CODES[code]


def _name_of(file: Path) -> str:
    name = "".join(c if c.isascii() and (c.isalnum() or c in "_-") else "_" for c in file.stem)
    return name.strip("_-") or "building"
