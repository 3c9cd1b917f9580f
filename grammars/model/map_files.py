"""Map files: YAML and image of ``map_server`` and nav2, plain pictures, and packed maps.

Pixels are read like ``map_server`` of Noetic does (``image_loader.cpp``): an occupancy of
(255 - grey) / 255, or grey / 255 with ``negate``, is occupied above ``occupied_thresh``, free below
``free_thresh`` and in between unknown (``mode: trinary``) or 1 to 99 (``scale``). With ``raw`` the
grey is the value itself, and values above 100 are unknown, as in nav2. The grey of a colour is the
mean of its channels, with ``trinary`` including alpha. With ``scale``, fully transparent cells in
between are unknown.

A packed map is a byte string that depends only on the content, so that its digest identifies it.
"""

from __future__ import annotations

import io
import json
import math
import re
import struct
import zlib
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Any, Final, Literal

import numpy as np
import numpy.typing as npt
from pydantic import Field

from grammars.model.grid import FREE, OCCUPIED, UNKNOWN, OccupancyGrid
from grammars.text import codec
from grammars.text.diagnostics import Finding, Findings, InputError, Where, closest, did_you_mean
from grammars.text.documents import StrictModel, YamlDocument, load_yaml, read_model
from grammars.text.file_kinds import kind_of_content
from grammars.text.plugins import load_extra
from grammars.text.sources import is_file, names_in, note_read

MOST_CELLS: Final = 64_000_000
"""Cells of a map at most: 400 m by 400 m at 5 cm."""
_WHITE: Final = 255
"""The lightest shade of 8 bits."""
_LONGEST_HEADER: Final = 4096
PICTURES: Final = (".png", ".jpg", ".jpeg", ".bmp", ".pgm", ".ppm", ".pbm")
"""Endings of images."""
_PPM: Final = dict.fromkeys((b"P1", b"P2", b"P3", b"P4", b"P5", b"P6"), "PPM")
_FORMATS: Final = {b"\x89P": "PNG", b"\xff\xd8": "JPEG", b"BM": "BMP", **_PPM}
"""Names of formats in pillow by the first bytes of a file."""
_COARSE: Final = 0.5
"""Cells [m] wider than any mapping tool makes for a robot in a building."""
_DEEP: Final = 65535
"""The lightest shade of 16 bits."""
# Magic number, columns, rows and largest grey with comments in between, then exactly one white
# space before the pixels (netpbm).
_HEADER: Final = re.compile(rb"(P[25])" + rb"(?:\s|#[^\n]*\n)+(\d{1,9})" * 3 + rb"\s", re.DOTALL)
_SAVED_UNKNOWN: Final = 205
_SAVED_GREYS: Final = {0, _SAVED_UNKNOWN, 254, _WHITE}
"""Greys that map_saver writes for occupied, unknown and free cells."""


class _MapKeys(StrictModel):
    """Keys of the YAML file of a map; unknown keys are ignored."""

    model_config = StrictModel.model_config | {"extra": "ignore"}

    image: str = Field(min_length=1, examples=["map.pgm"])
    resolution: float = Field(ge=0.001, le=10.0, examples=[0.05])
    origin: list[float] = Field(min_length=3, max_length=3, examples=[[0.0, 0.0, 0.0]])
    negate: bool = Field(examples=[0])
    occupied_thresh: float = Field(ge=0.0, le=1.0, examples=[0.65])
    free_thresh: float = Field(ge=0.0, le=1.0, examples=[0.196])
    mode: Literal["trinary", "scale", "raw"] = "trinary"


@dataclass(frozen=True, slots=True)
class SavedMap:
    """A map saved by a mapping tool; ``yaw`` [rad] turns ``grid`` about its origin."""

    grid: OccupancyGrid
    yaw: float
    warnings: tuple[Finding, ...]


def read_map(path: str | Path, *, turned: bool = False) -> SavedMap:
    """Read the map of a YAML file and its image.

    Warnings are about values and cells that probably mean something else. Images of more than
    8 bits, and other formats than PGM, need pillow. Raises :class:`InputError` for unreadable
    files, more than :data:`MOST_CELLS` cells, and a map with a yaw unless ``turned`` allows one.
    """
    document = load_yaml(path)
    text = read_model(document, _MapKeys)
    if text.free_thresh > text.occupied_thresh:
        raise InputError.at(
            document.where(("free_thresh",)), "free_thresh is above occupied_thresh"
        )
    findings, where = Findings(), document.where(("image",))
    _warn_of_keys(document, text, findings)
    yaw = text.origin[2]
    if yaw != 0.0 and not turned:
        raise InputError.at(
            document.where(("origin",)),
            f"the map is turned by {yaw:g} rad",
            "costmap_2d and amcl ignore that: turn the image and write 0 "
            "(scenario import accepts turned maps)",
        )
    # In trinary maps, alpha is one of the averaged channels.
    trinary = text.mode == "trinary"
    image_path = Path(path).parent / text.image
    image = _read_image(image_path, where, alpha_counts=trinary)
    grid = _grid(image, text)
    if trinary and image.clear is not None:
        colours = _grid(_read_image(image_path, where, alpha_counts=False), text)
        colours.cells[np.flipud(image.clear)] = UNKNOWN
        if share := float((colours.cells != grid.cells).mean()):
            message = (
                f"{share:.0%} of the cells differ from their colour: map_server includes the "
                "alpha channel in its average, which turns unknown cells into floor or walls"
            )
            hint = "save the image without an alpha channel, for your navigation stack too"
            findings.warning(where, message, hint)
    _warn_of_free_unknown(image, text, document.where(("free_thresh",)), findings)
    return SavedMap(grid, yaw, findings.warnings)


def read_picture(path: Path, resolution: float) -> OccupancyGrid:
    """Read a picture as a map: black is a wall, white is floor, transparent is unknown.

    Floor at the edge of the picture is unknown too, unless there is no other.
    ``resolution`` is the size of a pixel [m]. Raises :class:`InputError` for unreadable images.
    """
    from scipy import ndimage

    rest: dict[str, Any] = {"origin": [0.0, 0.0, 0.0], "negate": False, "free_thresh": 0.196}
    text = _MapKeys.model_construct(resolution=resolution, occupied_thresh=0.65, **rest)
    image = _read_image(path, Where(str(path)), alpha_counts=False)
    grid = _grid(image, text)
    if image.clear is not None:
        grid.cells[np.flipud(image.clear)] = UNKNOWN
    areas, _ = ndimage.label(grid.cells == FREE)
    edge = np.concatenate((areas[0], areas[-1], areas[:, 0], areas[:, -1]))
    outside = np.isin(areas, edge[edge > 0])
    if np.any((areas > 0) & ~outside):
        grid.cells[outside] = UNKNOWN
    return grid


def _warn_of_keys(document: YamlDocument, text: _MapKeys, findings: Findings) -> None:
    """Warn of names and values that probably mean something else."""
    for key in document.data.keys() - _MapKeys.model_fields.keys():
        if other := closest(key.lower(), _MapKeys.model_fields):
            message = f'unknown key "{key}" is ignored'
            findings.warning(document.where((key,)), message, f"did you mean {other}?")
    if text.resolution > _COARSE:
        message = f"a cell is {text.resolution:g} m wide"
        findings.warning(document.where(("resolution",)), message, "the resolution is in metres")
    if abs(yaw := text.origin[2]) > math.tau:
        message = f"the map is turned by {yaw:g} rad, {abs(yaw) / math.tau:.3g} turns"
        hint = f"write {math.radians(yaw):.6g} if {yaw:g} degrees are meant"
        findings.warning(document.where(("origin",)), message, hint)


def _warn_of_free_unknown(
    image: _MapImage, text: _MapKeys, where: Where, findings: Findings
) -> None:
    """Warn of maps of nav2's map_saver: it writes free_thresh 0.25 and 205 (0.196) for unknown."""
    values = _value_of_shades(image.shades, text)
    counts = np.bincount(image.levels.ravel(), minlength=len(values))
    is_saved = len(values) == _WHITE + 1 and set(np.flatnonzero(counts).tolist()) <= _SAVED_GREYS
    if is_saved and text.mode == "trinary" and not text.negate and values[_SAVED_UNKNOWN] == FREE:
        share = counts[_SAVED_UNKNOWN] / image.levels.size
        if share:
            message = (
                f"{share:.0%} of the cells are grey {_SAVED_UNKNOWN}, which map_saver writes for "
                f"unknown, but count as free because free_thresh is {text.free_thresh:g}"
            )
            hint = "write free_thresh: 0.196 to make them unknown, for your navigation stack too"
            findings.warning(where, message, hint)


def _grid(image: _MapImage, text: _MapKeys) -> OccupancyGrid:
    """Return the map of an image."""
    cells: npt.NDArray[np.int8] = _value_of_shades(image.shades, text)[np.flipud(image.levels)]
    if text.mode == "scale" and image.clear is not None:
        cells[np.flipud(image.clear) & (cells > FREE) & (cells < OCCUPIED)] = UNKNOWN
    return OccupancyGrid(text.resolution, text.origin[0], text.origin[1], cells)


def _value_of_shades(shade: npt.NDArray[np.float64], text: _MapKeys) -> npt.NDArray[np.int8]:
    """Return the occupancy values of shades of grey."""
    dark = shade if text.negate else _WHITE - shade
    occupancy = dark / float(_WHITE)
    if text.mode == "raw":
        # Here, negate inverts the grey, which is the value itself.
        number = _WHITE - shade if text.negate else shade
        value = np.where(number <= OCCUPIED, number, UNKNOWN)
    else:
        between: npt.NDArray[Any] = np.full(shade.shape, UNKNOWN)
        if text.mode == "scale" and text.occupied_thresh > text.free_thresh:
            span = text.occupied_thresh - text.free_thresh
            between = np.trunc(1.0 + 98.0 * (occupancy - text.free_thresh) / span)
        value = np.where(occupancy < text.free_thresh, FREE, between)
        value = np.where(occupancy > text.occupied_thresh, OCCUPIED, value)
    return value.astype(np.int8)


@dataclass(frozen=True, slots=True, eq=False)
class _MapImage:
    """The pixels of an image, top row first.

    ``levels`` are indices into ``shades``, greys from 0 (black) to 255 (white). ``clear`` marks
    fully transparent pixels if the image has an alpha channel.
    """

    levels: npt.NDArray[Any]
    shades: npt.NDArray[np.float64]
    clear: npt.NDArray[np.bool_] | None = None


def _read_image(path: Path, where: Where, *, alpha_counts: bool) -> _MapImage:
    """Return the shades of an image; ``where`` is the place of its name.

    The shade of a colour is the mean of its channels, including alpha with ``alpha_counts`` (like
    ``map_server``). Raises :class:`InputError` for unreadable images.
    """
    if not is_file(path):
        # Maps move between folders and machines.
        near = names_in(Path(where.file).parent, lambda file: file.suffix.lower() in PICTURES)
        hint = did_you_mean(re.split(r"[/\\]", path.name)[-1], near)
        raise InputError.at(where, f"the image {path} cannot be read: no such file", hint)
    note_read(path)
    try:
        size = path.stat().st_size
        if size > _LONGEST_HEADER + 4 * MOST_CELLS:
            raise InputError.at(where, f"the image {path.name} is too large ({size} bytes)")
        data = path.read_bytes()
    except OSError as error:
        reason = error.strerror or str(error)
        raise InputError.at(where, f"the image {path} cannot be read: {reason}") from error
    header = _HEADER.match(data[:_LONGEST_HEADER])
    if header is None or int(header[4]) > _WHITE:
        return _read_with_pillow(path, data, where, alpha_counts)
    return _MapImage(_read_pgm(data, header, path, where), np.arange(_WHITE + 1, dtype=np.float64))


def _read_with_pillow(path: Path, data: bytes, where: Where, alpha_counts: bool) -> _MapImage:
    name = _FORMATS.get(data[:2])
    if name is None:
        kind = kind_of_content(data[:_LONGEST_HEADER])
        about = kind.title if kind else "of another kind" if data else "empty"
        message = f"the image {path.name} is {about}"
        raise InputError.at(where, message, "images are PGM, PNG, BMP or JPEG files")
    pillow = load_extra("PIL.Image", "cad", f"a map as {name}", str(path))
    # Pillow complains about sizes that are refused below.
    pillow.MAX_IMAGE_PIXELS = None
    try:
        with pillow.open(io.BytesIO(data), formats=[name]) as image:
            _check_size(path, where, *image.size)
            if image.mode in ("1", "L"):
                levels = np.asarray(image.convert("L"))
                return _MapImage(levels, np.arange(_WHITE + 1, dtype=np.float64))
            if image.mode.startswith("I"):
                levels = np.asarray(image).astype(np.int64).clip(0, _DEEP)
                return _MapImage(levels, np.linspace(0.0, _WHITE, _DEEP + 1))
            alpha = image.mode in ("LA", "PA", "RGBA") or "transparency" in image.info
            pixels = np.asarray(image.convert("RGBA" if alpha else "RGB"))
    # A damaged file makes pillow raise any of these.
    except (OSError, SyntaxError, ValueError, EOFError, struct.error, zlib.error) as error:
        message = f"the image {path.name} is a damaged {name} file: {error}"
        raise InputError.at(where, message, "save the map again") from error
    channels = 4 if alpha and alpha_counts else 3
    levels = pixels[..., :channels].sum(axis=2, dtype=np.uint16)
    shades = np.linspace(0.0, _WHITE, _WHITE * channels + 1)
    return _MapImage(levels, shades, pixels[..., -1] == 0 if alpha else None)


def _check_size(path: Path, where: Where, columns: int, rows: int) -> None:
    if not (columns and rows):
        raise InputError.at(where, f"the image {path.name} has no pixels")
    if columns * rows > MOST_CELLS:
        message = f"the image {path.name} has {columns * rows} pixels"
        raise InputError.at(where, message, f"at most {MOST_CELLS} can be read")


def _read_pgm(
    data: bytes, header: re.Match[bytes], path: Path, where: Where
) -> npt.NDArray[np.uint8]:
    """Return the greys of an image, top row first."""
    columns, rows, largest = (int(number) for number in header.groups()[1:])
    _check_size(path, where, columns, rows)
    if largest < 1:
        raise InputError.at(where, f"the image {path.name} has greys up to {largest}")
    pixels = _pixels(data[header.end() :], header[1] == b"P5", where, path.name)
    if len(pixels) != columns * rows:
        message = f"the image {path.name} has {len(pixels)} pixels, its header says"
        raise InputError.at(where, f"{message} {columns} x {rows} = {columns * rows}")
    if pixels.max() > largest:
        raise InputError.at(where, f"the image {path.name} has pixels above {largest}")
    if largest < _WHITE:
        # Like SDL_image, which map_server uses.
        pixels = pixels.astype(np.uint16) * _WHITE // largest
    return pixels.astype(np.uint8).reshape(rows, columns)


def _pixels(data: bytes, binary: bool, where: Where, image: str) -> npt.NDArray[Any]:
    if binary:
        return np.frombuffer(data, dtype=np.uint8)
    words = re.sub(rb"#[^\n]*", b"", data).split()
    if not all(word.isdigit() and len(word) <= 3 for word in words):
        raise InputError.at(where, f"the image {image} has pixels that are not numbers")
    return np.array(words, dtype=np.uint16)


def write_map(grid: OccupancyGrid, stem: Path, *, laser_height: float) -> tuple[Path, Path]:
    """Write ``<stem>.pgm`` and ``<stem>.yaml`` for ROS ``map_server`` and nav2; return both paths.

    Free is 254, occupied 0 and unknown 205, with thresholds of 0.65 and 0.196. A map with other
    values is written with ``mode: raw`` and unknown as 255. ``laser_height`` [m] is noted in the
    files.
    """
    image, meta = (stem.with_name(stem.name + suffix) for suffix in (".pgm", ".yaml"))
    raw = bool(((grid.cells > FREE) & (grid.cells < OCCUPIED)).any())
    if raw:
        grey = grid.cells.astype(np.uint8)
    else:
        # Like map_saver of ROS: 205 is an occupancy of 50 / 255, above free_thresh.
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
    """Head of a packed map; the cells follow, one byte each, row by row from the lowest."""

    resolution: Annotated[float, Field(gt=0.0)]
    x: float
    y: float
    rows: Annotated[int, Field(ge=1)]
    columns: Annotated[int, Field(ge=1)]


def pack_map(grid: OccupancyGrid) -> bytes:
    """Return a map as bytes; equal maps give equal bytes."""
    rows, columns = grid.cells.shape
    head = _Head(grid.resolution, grid.x, grid.y, rows, columns)
    return codec.to_json(head) + b"\n" + grid.cells.astype(np.int8).tobytes()


def unpack_map(data: bytes) -> OccupancyGrid:
    """Return a packed map; raises ``ValueError`` for other data."""
    line, _, rest = data.partition(b"\n")
    head = codec.from_json(_Head, line, exactly=True)
    cells = np.frombuffer(rest, dtype=np.int8)
    if len(cells) != head.rows * head.columns or len(cells) > MOST_CELLS:
        raise ValueError(f"a map of {head.rows} x {head.columns} cells has {len(cells)}")
    if cells.min() < UNKNOWN or cells.max() > OCCUPIED:
        raise ValueError("a map has values from -1 to 100 only")
    return OccupancyGrid(head.resolution, head.x, head.y, cells.reshape(head.rows, head.columns))
