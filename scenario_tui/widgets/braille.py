"""A canvas of braille dots: two by four of them in every terminal cell, in layers."""

from __future__ import annotations

from typing import Final

import numpy as np
import numpy.typing as npt

from grammars.values import Floats

BLANK: Final = 0x2800
_BITS: Final = np.array([[0x01, 0x08], [0x02, 0x10], [0x04, 0x20], [0x40, 0x80]], dtype=np.uint8)

Cells = npt.NDArray[np.uint8]
Codes = npt.NDArray[np.int32]


class Canvas:
    """Dots of several layers over ``columns`` x ``rows`` cells; dot (0, 0) is at the top left."""

    def __init__(self, columns: int, rows: int, layers: int) -> None:
        self.columns, self.rows = columns, rows
        self._dots: Cells = np.zeros((layers, rows, columns), dtype=np.uint8)
        self._glyphs: dict[tuple[int, int], tuple[str, int]] = {}

    @property
    def width(self) -> int:
        """Dots across."""
        return 2 * self.columns

    @property
    def height(self) -> int:
        """Dots down."""
        return 4 * self.rows

    def copy_layer(self, other: Canvas, layer: int) -> None:
        """Take a layer over from a canvas of the same size."""
        self._dots[layer] = other._dots[layer]

    def points(self, dots: Floats, layer: int) -> None:
        """Set dots, shape (n, 2) as x, y; what lies outside is left out."""
        whole = np.rint(dots).astype(np.int64)
        inside = np.all((whole >= 0) & (whole < (self.width, self.height)), axis=1)
        x, y = whole[inside].T
        bits = _BITS[y % 4, x % 2]
        np.bitwise_or.at(self._dots[layer], (y // 4, x // 2), bits)

    def lines(self, segments: Floats, layer: int) -> None:
        """Draw straight lines, shape (n, 4) as x0, y0, x1, y1 in dots."""
        if len(segments) == 0:
            return
        start, way = segments[:, :2], segments[:, 2:] - segments[:, :2]
        steps = np.ceil(np.max(np.abs(way), axis=1)).astype(np.int64) + 1
        line = np.repeat(np.arange(len(segments)), steps)
        first = np.repeat(np.cumsum(steps) - steps, steps)
        along = (np.arange(len(line)) - first) / np.maximum(steps[line] - 1, 1)
        self.points(start[line] + along[:, None] * way[line], layer)

    def glyph(self, x: float, y: float, character: str, layer: int) -> None:
        """Put a character into the cell that holds the dot (x, y), over all dots."""
        column, row = int(x // 2), int(y // 4)
        if 0 <= column < self.columns and 0 <= row < self.rows:
            self._glyphs[(row, column)] = (character, layer)

    def cells(self) -> tuple[Codes, Codes]:
        """Return code points and layers, shape (rows, columns) each; layer -1 is empty.

        A cell belongs to its highest layer with a dot, and shows the dots of all layers.
        """
        codes = np.bitwise_or.reduce(self._dots, axis=0).astype(np.int32) + BLANK
        owners = np.full((self.rows, self.columns), -1, dtype=np.int32)
        for layer, dots in enumerate(self._dots):
            owners[dots > 0] = layer
        codes[owners < 0] = ord(" ")
        for place, (character, layer) in self._glyphs.items():
            codes[place] = ord(character)
            owners[place] = layer
        return codes, owners
