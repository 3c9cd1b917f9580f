"""The images of maps: PGM, read here, and PNG, read by pillow, as shades of grey."""

from __future__ import annotations

import re
import struct
import zlib
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Final

import numpy as np
import numpy.typing as npt

from grammars.text.diagnostics import InputError, Where
from grammars.text.plugins import load_extra
from grammars.text.sources import is_file, note_read

MOST_CELLS: Final = 64_000_000
"""A map of 400 m by 400 m at 5 cm; more is refused before it is read."""
WHITE: Final = 255
"""The lightest shade of 8 bits."""
_LONGEST_HEADER: Final = 4096
_PNG: Final = b"\x89PNG\r\n\x1a\n"
_DEEP: Final = 65535
"""The lightest shade of 16 bits."""
# The words before the pixels: magic number, columns, rows, largest grey, with comments in between,
# and exactly one white space after the last (netpbm).
_HEADER: Final = re.compile(rb"(P[25])" + rb"(?:\s|#[^\n]*\n)+(\d{1,9})" * 3 + rb"\s", re.DOTALL)


@dataclass(frozen=True, slots=True, eq=False)
class MapImage:
    """The pixels of an image, top row first.

    ``levels`` are indices into ``shades``, which are the greys they stand for, 0 black to 255
    white; ``clear`` says which pixels are quite transparent, if the image has an alpha channel.
    """

    levels: npt.NDArray[Any]
    shades: npt.NDArray[np.float64]
    clear: npt.NDArray[np.bool_] | None = None


def read_image(path: Path, named: Where, *, alpha_counts: bool) -> MapImage:
    """Return the shades of an image; ``named`` is where its name stands.

    The shade of a colour is the mean of its channels, alpha among them with ``alpha_counts``, as
    ``map_server`` has it. Raises :class:`InputError` for what cannot be read.
    """
    if not is_file(path):
        raise InputError.at(named, f"the image {path} cannot be read: No such ordinary file")
    note_read(path)
    try:
        size = path.stat().st_size
        if size > _LONGEST_HEADER + 4 * MOST_CELLS:
            raise InputError.at(named, f"the image {path.name} has {size} bytes, that is too large")
        data = path.read_bytes()
    except OSError as error:
        reason = error.strerror or str(error)
        raise InputError.at(named, f"the image {path} cannot be read: {reason}") from error
    if data.startswith(_PNG):
        return _read_png(path, data[: len(_PNG) + 16], named, alpha_counts)
    return MapImage(_read_pgm(data, path, named), np.arange(WHITE + 1, dtype=np.float64))


def _read_png(path: Path, head: bytes, named: Where, alpha_counts: bool) -> MapImage:
    # The size stands in the first chunk; it is looked at before anything is unpacked.
    if len(head) == len(_PNG) + 16:
        _check_size(path, named, *struct.unpack(">II", head[-8:]))
    pillow = load_extra("PIL.Image", "import", "a map as PNG", str(path))
    try:
        with pillow.open(path, formats=["PNG"]) as image:
            if image.mode in ("1", "L"):
                levels = np.asarray(image.convert("L"))
                return MapImage(levels, np.arange(WHITE + 1, dtype=np.float64))
            if image.mode.startswith("I"):
                levels = np.asarray(image).astype(np.int64).clip(0, _DEEP)
                return MapImage(levels, np.linspace(0.0, WHITE, _DEEP + 1))
            alpha = image.mode in ("LA", "PA", "RGBA") or "transparency" in image.info
            pixels = np.asarray(image.convert("RGBA" if alpha else "RGB"))
    # A damaged PNG makes pillow raise any of these.
    except (OSError, SyntaxError, ValueError, EOFError, struct.error, zlib.error) as error:
        message = f"the image {path.name} is a damaged PNG file: {error}"
        raise InputError.at(named, message, "save the map again") from error
    channels = 4 if alpha and alpha_counts else 3
    levels = pixels[..., :channels].sum(axis=2, dtype=np.uint16)
    shades = np.linspace(0.0, WHITE, WHITE * channels + 1)
    return MapImage(levels, shades, pixels[..., -1] == 0 if alpha else None)


def _check_size(path: Path, named: Where, columns: int, rows: int) -> None:
    if not (columns and rows):
        raise InputError.at(named, f"the image {path.name} has no pixels")
    if columns * rows > MOST_CELLS:
        message = f"the image {path.name} has {columns * rows} pixels"
        raise InputError.at(named, message, f"at most {MOST_CELLS} can be read")


def _read_pgm(data: bytes, path: Path, named: Where) -> npt.NDArray[np.uint8]:
    """Return the grey of an image, top row first."""
    header = _HEADER.match(data[:_LONGEST_HEADER])
    if header is None:
        message = f"the image {path.name} is neither a PGM nor a PNG file"
        raise InputError.at(named, message, f"convert {path.name} map.pgm makes one")
    columns, rows, largest = (int(number) for number in header.groups()[1:])
    _check_size(path, named, columns, rows)
    if not 1 <= largest <= WHITE:
        message = f"the image {path.name} counts to {largest}"
        raise InputError.at(named, message, "only images of 8 bits can be read")
    pixels = _pixels(data[header.end() :], header[1] == b"P5", named, path.name)
    if len(pixels) != columns * rows:
        message = f"the image {path.name} has {len(pixels)} pixels, its header says"
        raise InputError.at(named, f"{message} {columns} x {rows} = {columns * rows}")
    if pixels.max() > largest:
        raise InputError.at(named, f"the image {path.name} has pixels above {largest}")
    if largest < WHITE:
        # As SDL_image does, with which map_server reads.
        pixels = pixels.astype(np.uint16) * WHITE // largest
    return pixels.astype(np.uint8).reshape(rows, columns)


def _pixels(data: bytes, binary: bool, named: Where, image: str) -> npt.NDArray[Any]:
    if binary:
        return np.frombuffer(data, dtype=np.uint8)
    words = data.split()
    if not all(word.isdigit() and len(word) <= 3 for word in words):
        raise InputError.at(named, f"the image {image} has pixels that are no numbers")
    return np.array(words, dtype=np.uint16)
