"""The figure as PNG: drawn larger with Pillow and scaled down, so that edges are smooth."""

from __future__ import annotations

import itertools
import math
from collections.abc import Iterator
from functools import cache
from pathlib import Path
from typing import Any, Final

from PIL import Image, ImageColor, ImageDraw, ImageFont

from grammars.model.geometry import Point2
from templates.picture._drawing import Disc, Drawing, Shape, TextLabel

_FINE: Final = 3
_DOWN: Final = 2
PNG_SCALE: Final = _FINE / _DOWN
"""Pixels of the PNG in a unit of the page."""


def write_png(figure: Drawing, path: Path) -> Path:
    """Write the figure, :data:`PNG_SCALE` times as large as its page, and return the path."""
    size = (round(figure.width * PNG_SCALE) * _DOWN, round(figure.height * PNG_SCALE) * _DOWN)
    image = Image.new("RGB", size, figure.background)
    pen = ImageDraw.Draw(image, "RGBA")
    for group in figure.groups:
        for item in group.items:
            match item:
                case Shape():
                    _shape(image, pen, item)
                case Disc():
                    _disc(pen, item)
                case TextLabel():
                    _words(image, pen, item)
    small = image.reduce(_DOWN)
    small.save(path, format="PNG", optimize=False, compress_level=4)
    return path


def _shape(image: Image.Image, pen: ImageDraw.ImageDraw, item: Shape) -> None:
    rings = [[_fine(p) for p in ring] for ring in item.rings]
    if item.fill and len(rings) == 1:
        pen.polygon(rings[0], fill=_colour(item.fill, item.opacity))
    elif item.fill:
        _fill_even_odd(image, rings, _colour(item.fill, item.opacity))
    if item.line:
        colour, width = _colour(item.line, item.opacity), max(round(item.width * _FINE), 1)
        for ring in rings:
            line = ring if item.open else [*ring, ring[0]]
            for piece in _dashed(line, item.dash) if item.dash else [line]:
                pen.line(piece, fill=colour, width=width, joint="curve")


def _fill_even_odd(image: Image.Image, rings: list[list[Point2]], colour: Any) -> None:
    """Fill rings of which holes are cut out, in whatever order they come."""
    mask = Image.new("1", image.size)
    pen = ImageDraw.Draw(mask)
    by_size = sorted(rings, key=_area, reverse=True)
    depth = 0
    for i, ring in enumerate(by_size):
        depth = sum(_inside(ring[0], other) for other in by_size[:i])
        pen.polygon(ring, fill=depth % 2 == 0)
    image.paste(colour[:3], mask=mask)


def _disc(pen: ImageDraw.ImageDraw, item: Disc) -> None:
    (x, y), r = _fine(item.centre), item.radius * _FINE
    line = _colour(item.line, 1.0) if item.line else None
    width = max(round(item.width * _FINE), 1)
    pen.ellipse((x - r, y - r, x + r, y + r), fill=item.fill, outline=line, width=width)


def _words(image: Image.Image, pen: ImageDraw.ImageDraw, item: TextLabel) -> None:
    font = _font(max(round(item.size * _FINE), 4))
    anchor = {"start": "ls", "middle": "ms", "end": "rs"}[item.anchor]
    stroke = round(2.2 * _FINE) if item.halo else 0
    bold = round(0.35 * _FINE) if item.bold else 0
    x, y = _fine(item.at)
    if item.centred:
        anchor = anchor[0] + "m"
    if not item.turn:
        if stroke:
            pen.text((x, y), item.text, item.halo, font, anchor, stroke_width=stroke)
        pen.text((x, y), item.text, item.colour, font, anchor, stroke_width=bold)
        return
    left, top, right, bottom = font.getbbox(item.text, anchor="mm", stroke_width=stroke)
    half = max(-left, right) + 2.0, max(-top, bottom) + 2.0
    for colour, width in ((item.halo, stroke), (item.colour, bold)):
        if colour:
            mask = Image.new("L", (math.ceil(2 * half[0]), math.ceil(2 * half[1])))
            ImageDraw.Draw(mask).text(half, item.text, 255, font, "mm", stroke_width=width)
            turned = mask.rotate(item.turn, Image.Resampling.BICUBIC, expand=True)
            corner = (round(x - turned.width / 2), round(y - turned.height / 2))
            image.paste(colour, corner, turned)


@cache
def _font(size: int) -> ImageFont.FreeTypeFont:
    font = ImageFont.load_default(size)
    if not isinstance(font, ImageFont.FreeTypeFont):
        raise RuntimeError("Pillow was built without FreeType, it cannot write text")
    return font


def _colour(name: str, opacity: float) -> tuple[int, ...]:
    return (*ImageColor.getrgb(name)[:3], round(255 * opacity))


def _fine(point: Point2) -> Point2:
    return (point[0] * _FINE, point[1] * _FINE)


def _dashed(line: list[Point2], dash: tuple[float, float]) -> Iterator[list[Point2]]:
    """Return the pieces of a line that are drawn."""
    on, off = dash[0] * _FINE, dash[1] * _FINE
    drawn, left = True, on
    piece = [line[0]]
    for a, b in itertools.pairwise(line):
        length, done = math.dist(a, b), 0.0
        while length - done > left:
            done += left
            share = done / length
            at = (a[0] + (b[0] - a[0]) * share, a[1] + (b[1] - a[1]) * share)
            if drawn:
                yield [*piece, at]
            drawn = not drawn
            left = on if drawn else off
            piece = [at]
        left -= length - done
        piece.append(b)
    if drawn and len(piece) > 1:
        yield piece


def _area(ring: list[Point2]) -> float:
    pairs = zip(ring, ring[1:] + ring[:1], strict=True)
    return abs(sum(a[0] * b[1] - b[0] * a[1] for a, b in pairs))


def _inside(point: Point2, ring: list[Point2]) -> bool:
    x, y = point
    inside = False
    for (ax, ay), (bx, by) in zip(ring, ring[1:] + ring[:1], strict=True):
        if (ay > y) != (by > y) and x < ax + (y - ay) / (by - ay) * (bx - ax):
            inside = not inside
    return inside
