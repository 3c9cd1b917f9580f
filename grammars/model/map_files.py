"""Maps as files: the YAML and the PGM image that ``map_server`` and nav2 read, and in one piece.

Pixels mean what they mean to ``map_server`` of Noetic (``image_loader.cpp``): an occupancy of
(255 - grey) / 255, or grey / 255 with ``negate``, is occupied above ``occupied_thresh``, free below
``free_thresh`` and in between unknown (``mode: trinary``) or 1 to 99 (``scale``). With ``raw`` the
grey is the value itself, and what is above 100 unknown, as nav2 has it.

Packed, a map is one piece of bytes that only its content decides, so that its digest can name it.
"""

from __future__ import annotations

import json
import re
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Any, Final, Literal

import numpy as np
import numpy.typing as npt
from pydantic import Field

from grammars.model.grid import FREE, OCCUPIED, UNKNOWN, OccupancyGrid
from grammars.text import codec
from grammars.text.diagnostics import InputError, Where
from grammars.text.documents import (
    StrictModel,
    YamlDocument,
    load_yaml,
    read_model,
)
from grammars.text.sources import is_file

MOST_CELLS: Final = 64_000_000
"""A map of 400 m by 400 m at 5 cm; more is refused before it is read."""
_LONGEST_HEADER: Final = 4096
_GREY: Final = 255
# The words before the pixels: magic number, columns, rows, largest grey, with comments in between,
# and exactly one white space after the last (netpbm).
_HEADER: Final = re.compile(rb"(P[25])" + rb"(?:\s|#[^\n]*\n)+(\d{1,9})" * 3 + rb"\s", re.DOTALL)

_Share = Annotated[float, Field(ge=0.0, le=1.0)]


class _MapKeys(StrictModel):
    """The keys of a map's YAML file; others are for other readers."""

    model_config = StrictModel.model_config | {"extra": "ignore"}

    image: str = Field(min_length=1)
    resolution: Annotated[float, Field(ge=0.001, le=10.0)]
    origin: Annotated[list[float], Field(min_length=3, max_length=3)]
    negate: Annotated[int, Field(ge=0, le=1)]
    occupied_thresh: _Share
    free_thresh: _Share
    mode: Literal["trinary", "scale", "raw"] = "trinary"


def read_map(path: str | Path) -> OccupancyGrid:
    """Read the map of a YAML file, its image from beside it.

    Raises :class:`InputError` for files that cannot be read, an image that is no PGM (P5 or P2,
    up to 8 bits), more than :data:`MOST_CELLS` cells, and a map that is turned.
    """
    document = load_yaml(path)
    text = read_model(document, _MapKeys)
    _refuse(document, text)
    image = Path(path).parent / text.image
    grey = _read_image(image, document.where(("image",)))
    return OccupancyGrid(text.resolution, text.origin[0], text.origin[1], _values(grey, text))


def _refuse(document: YamlDocument, text: _MapKeys) -> None:
    if text.origin[2] != 0.0:
        raise InputError.at(
            document.where(("origin",)),
            f"the map is turned by {text.origin[2]:g} rad",
            "costmap_2d and amcl take no notice of that: turn the image and write 0",
        )
    if text.free_thresh > text.occupied_thresh:
        raise InputError.at(
            document.where(("free_thresh",)), "free_thresh is above occupied_thresh"
        )


def _values(grey: npt.NDArray[np.uint8], text: _MapKeys) -> npt.NDArray[np.int8]:
    """Return the occupancy values of an image, lowest row first."""
    shade = np.arange(_GREY + 1)
    dark = shade if text.negate else _GREY - shade
    occupancy = dark / float(_GREY)
    if text.mode == "raw":
        # Here, negate turns the grey and not its meaning: what is kept is the number.
        number = _GREY - shade if text.negate else shade
        value = np.where(number <= OCCUPIED, number, UNKNOWN)
    else:
        between: npt.NDArray[Any] = np.full(_GREY + 1, UNKNOWN)
        if text.mode == "scale" and text.occupied_thresh > text.free_thresh:
            span = text.occupied_thresh - text.free_thresh
            between = np.trunc(1.0 + 98.0 * (occupancy - text.free_thresh) / span)
        value = np.where(occupancy < text.free_thresh, FREE, between)
        value = np.where(occupancy > text.occupied_thresh, OCCUPIED, value)
    cells: npt.NDArray[np.int8] = value.astype(np.int8)[np.flipud(grey)]
    return cells


def _read_image(path: Path, named: Where) -> npt.NDArray[np.uint8]:
    """Return the grey of an image, top row first; ``named`` is where its name stands."""
    if not is_file(path):
        raise InputError.at(named, f"the image {path} cannot be read: No such ordinary file")
    try:
        size = path.stat().st_size
        if size > _LONGEST_HEADER + 4 * MOST_CELLS:
            raise InputError.at(named, f"the image {path.name} has {size} bytes, that is too large")
        data = path.read_bytes()
    except OSError as error:
        reason = error.strerror or str(error)
        raise InputError.at(named, f"the image {path} cannot be read: {reason}") from error
    found = _HEADER.match(data[:_LONGEST_HEADER])
    if found is None:
        raise InputError.at(
            named, f"the image {path.name} is no PGM file", f"convert {path.name} map.pgm makes one"
        )
    columns, rows, largest = (int(number) for number in found.groups()[1:])
    if not (columns and rows):
        raise InputError.at(named, f"the image {path.name} has no pixels")
    if columns * rows > MOST_CELLS:
        message = f"the image {path.name} has {columns * rows} pixels"
        raise InputError.at(named, message, f"at most {MOST_CELLS} can be read")
    if not 1 <= largest <= _GREY:
        message = f"the image {path.name} counts to {largest}"
        raise InputError.at(named, message, "only images of 8 bits can be read")
    pixels = _pixels(data[found.end() :], found[1] == b"P5", named, path.name)
    if len(pixels) != columns * rows:
        message = f"the image {path.name} has {len(pixels)} pixels, its header says"
        raise InputError.at(named, f"{message} {columns} x {rows} = {columns * rows}")
    if pixels.max() > largest:
        raise InputError.at(named, f"the image {path.name} has pixels above {largest}")
    if largest < _GREY:
        # As SDL_image does, with which map_server reads.
        pixels = pixels.astype(np.uint16) * _GREY // largest
    return pixels.astype(np.uint8).reshape(rows, columns)


def _pixels(data: bytes, binary: bool, named: Where, image: str) -> npt.NDArray[Any]:
    if binary:
        return np.frombuffer(data, dtype=np.uint8)
    words = data.split()
    if not all(word.isdigit() and len(word) <= 3 for word in words):
        raise InputError.at(named, f"the image {image} has pixels that are no numbers")
    return np.array(words, dtype=np.uint16)


def write_map(grid: OccupancyGrid, stem: Path, *, laser_height: float) -> tuple[Path, Path]:
    """Write ``<stem>.pgm`` and ``<stem>.yaml`` for ROS ``map_server`` and nav2; return both paths.

    Free is 254, occupied 0 and unknown 205, which the thresholds written (0.65 and 0.196) read
    back as such. A map with values in between has them as they are (``mode: raw``, unknown 255).
    ``laser_height`` [m] is noted in the files.
    """
    image, meta = (stem.with_name(stem.name + suffix) for suffix in (".pgm", ".yaml"))
    raw = bool(((grid.cells > FREE) & (grid.cells < OCCUPIED)).any())
    if raw:
        grey = grid.cells.astype(np.uint8)
    else:
        # As map_saver of ROS writes them: 205 is an occupancy of 50 / 255, above free_thresh.
        grey = np.full_like(grid.cells, 205, dtype=np.uint8)
        grey[grid.cells == FREE] = 254
        grey[grid.cells == OCCUPIED] = 0
    note = f"laser at {laser_height:g} m, {grid.resolution:g} m per cell"
    header = f"P5\n# {note}\n{len(grey[0])} {len(grey)}\n255\n".encode()
    image.write_bytes(header + np.flipud(grey).tobytes())
    meta.write_text(
        f"# {note}\n"
        f"image: {json.dumps(image.name)}\n"
        f"mode: {'raw' if raw else 'trinary'}\n"
        f"resolution: {grid.resolution!r}\n"
        f"origin: [{grid.x!r}, {grid.y!r}, 0.0]\n"
        "negate: 0\n"
        "occupied_thresh: 0.65\n"
        "free_thresh: 0.196\n",
        encoding="utf-8",
    )
    return image, meta


@dataclass(frozen=True, slots=True)
class _Head:
    """What a packed map begins with; its cells follow, row by row from the lowest, a byte each."""

    resolution: Annotated[float, Field(gt=0.0)]
    x: float
    y: float
    rows: Annotated[int, Field(ge=1)]
    columns: Annotated[int, Field(ge=1)]


def pack_map(grid: OccupancyGrid) -> bytes:
    """Return a map as bytes, the same for the same map."""
    rows, columns = grid.cells.shape
    head = _Head(grid.resolution, grid.x, grid.y, rows, columns)
    return codec.to_json(head) + b"\n" + grid.cells.astype(np.int8).tobytes()


def unpack_map(data: bytes) -> OccupancyGrid:
    """Return a map that was packed; raises ``ValueError`` for anything else."""
    line, _, rest = data.partition(b"\n")
    head = codec.from_json(_Head, line, exactly=True)
    cells = np.frombuffer(rest, dtype=np.int8)
    if len(cells) != head.rows * head.columns or len(cells) > MOST_CELLS:
        raise ValueError(f"a map of {head.rows} x {head.columns} cells has {len(cells)}")
    if cells.min() < UNKNOWN or cells.max() > OCCUPIED:
        raise ValueError("a map has values from -1 to 100 only")
    return OccupancyGrid(head.resolution, head.x, head.y, cells.reshape(head.rows, head.columns))
