"""Maps as files: the YAML and the image that ``map_server`` and nav2 read, and in one piece.

Pixels mean the same as to ``map_server`` of Noetic (``image_loader.cpp``): an occupancy of
(255 - grey) / 255, or grey / 255 with ``negate``, is occupied above ``occupied_thresh``, free below
``free_thresh`` and in between unknown (``mode: trinary``) or 1 to 99 (``scale``). With ``raw`` the
grey is the value itself, and values above 100 are unknown, as nav2 has it. Colours count as the
mean of their channels, in which ``trinary`` has a share for alpha. With ``scale``, quite
transparent cells in between are unknown.

Packed, a map is one piece of bytes that only its content decides, so that its digest can name it.
"""

from __future__ import annotations

import json
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Any, Final, Literal

import numpy as np
import numpy.typing as npt
from pydantic import Field

from grammars.model.grid import FREE, OCCUPIED, UNKNOWN, OccupancyGrid
from grammars.model.map_images import MOST_CELLS, WHITE, MapImage, read_image
from grammars.text import codec
from grammars.text.diagnostics import Finding, Findings, InputError, Where
from grammars.text.documents import StrictModel, load_yaml, read_model

_SAVED_UNKNOWN: Final = 205
_SAVED_GREYS: Final = {0, _SAVED_UNKNOWN, 254, WHITE}
"""The greys in which map_saver writes occupied, unknown and free cells."""

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


@dataclass(frozen=True, slots=True)
class SavedMap:
    """A map as a mapping tool saved it.

    ``grid`` lies straight; ``yaw`` [rad] turns it about its origin.
    """

    grid: OccupancyGrid
    yaw: float
    warnings: tuple[Finding, ...]


def read_map(path: str | Path, *, turned: bool = False) -> SavedMap:
    """Read the map of a YAML file, its image from beside it.

    Warnings are about unknown cells that count as free or occupied. Raises :class:`InputError` for
    files that cannot be read, an image that is neither PGM (P5 or P2, up to 8 bits) nor PNG, more
    than :data:`MOST_CELLS` cells, and a map with a yaw unless it may be ``turned``.
    """
    document = load_yaml(path)
    text = read_model(document, _MapKeys)
    if text.free_thresh > text.occupied_thresh:
        raise InputError.at(
            document.where(("free_thresh",)), "free_thresh is above occupied_thresh"
        )
    yaw = text.origin[2]
    if yaw != 0.0 and not turned:
        raise InputError.at(
            document.where(("origin",)),
            f"the map is turned by {yaw:g} rad",
            "costmap_2d and amcl take no notice of that: turn the image and write 0 "
            "(scenario import makes a building of it as it is)",
        )
    findings, where = Findings(), document.where(("image",))
    # In trinary maps alpha is one more channel of the mean.
    trinary = text.mode == "trinary"
    image = read_image(Path(path).parent / text.image, where, alpha_counts=trinary)
    grid = _grid(image, text)
    if trinary and image.clear is not None:
        colours = _grid(read_image(Path(path).parent / text.image, where, alpha_counts=False), text)
        colours.cells[np.flipud(image.clear)] = UNKNOWN
        if share := float((colours.cells != grid.cells).mean()):
            message = (
                f"{share:.0%} of the cells are not what their colour says: map_server averages "
                "the alpha channel in, which makes floor or walls of unknown cells"
            )
            hint = "save the image without an alpha channel, for your navigation stack too"
            findings.warning(where, message, hint)
    _warn_of_free_unknown(image, text, document.where(("free_thresh",)), findings)
    return SavedMap(grid, yaw, findings.warnings)


def _warn_of_free_unknown(
    image: MapImage, text: _MapKeys, where: Where, findings: Findings
) -> None:
    """Warn of a map of nav2's map_saver: free_thresh 0.25, and 205 for unknown (0.196)."""
    values = _value_of_shades(image.shades, text)
    used = np.bincount(image.levels.ravel(), minlength=len(values))
    saved = len(values) == WHITE + 1 and set(np.flatnonzero(used).tolist()) <= _SAVED_GREYS
    if saved and text.mode == "trinary" and not text.negate and values[_SAVED_UNKNOWN] == FREE:
        share = used[_SAVED_UNKNOWN] / image.levels.size
        if share:
            message = (
                f"{share:.0%} of the cells are grey {_SAVED_UNKNOWN}, as which map_saver writes "
                f"unknown, but free by free_thresh {text.free_thresh:g}: they count as floor"
            )
            hint = "write free_thresh: 0.196 to have them unknown, for your navigation stack too"
            findings.warning(where, message, hint)


def _grid(image: MapImage, text: _MapKeys) -> OccupancyGrid:
    """Return the map that an image shows."""
    cells: npt.NDArray[np.int8] = _value_of_shades(image.shades, text)[np.flipud(image.levels)]
    if text.mode == "scale" and image.clear is not None:
        cells[np.flipud(image.clear) & (cells > FREE) & (cells < OCCUPIED)] = UNKNOWN
    return OccupancyGrid(text.resolution, text.origin[0], text.origin[1], cells)


def _value_of_shades(shade: npt.NDArray[np.float64], text: _MapKeys) -> npt.NDArray[np.int8]:
    """Return the occupancy values of shades of grey."""
    dark = shade if text.negate else WHITE - shade
    occupancy = dark / float(WHITE)
    if text.mode == "raw":
        # Here, negate turns the grey and not its meaning: what is kept is the number.
        number = WHITE - shade if text.negate else shade
        value = np.where(number <= OCCUPIED, number, UNKNOWN)
    else:
        between: npt.NDArray[Any] = np.full(shade.shape, UNKNOWN)
        if text.mode == "scale" and text.occupied_thresh > text.free_thresh:
            span = text.occupied_thresh - text.free_thresh
            between = np.trunc(1.0 + 98.0 * (occupancy - text.free_thresh) / span)
        value = np.where(occupancy < text.free_thresh, FREE, between)
        value = np.where(occupancy > text.occupied_thresh, OCCUPIED, value)
    return value.astype(np.int8)


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
    """Head of a packed map; its cells follow, row by row from the lowest, a byte each."""

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
