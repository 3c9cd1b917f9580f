"""The moving picture of the README, made from the recording of the first hour.

An SVG file with one screen a second: pages show it without a script or a player. Equal rows are
stored once. Readers who ask for reduced motion see one screen that stands still.
"""

import html
import itertools
import json

import pyte

from campaigns.studies.pictures.session_cast import CAST

MOVING = CAST.with_name("first-hour.svg")
STILL = 0.6
"""Share of the recording after which the screen for readers without motion is taken."""
_CELL, _LINE, _EDGE = 8.4, 18.0, 10.0
"""Width and height of a character, and the edge of the picture [px]."""
_COLOURS = {
    "black": "#1b1f24",
    "red": "#e06c75",
    "green": "#98c379",
    "brown": "#d19a66",
    "yellow": "#e5c07b",
    "blue": "#61afef",
    "magenta": "#c678dd",
    "cyan": "#56b6c2",
    "white": "#c8ccd4",
    "brightblack": "#7f848e",
}
_INK, _PAPER = "#c8ccd4", "#000000"


def _screens():
    """Yield the rows of cells of the recording, once a second."""
    head, *events = map(json.loads, CAST.read_text("utf-8").splitlines())
    screen = pyte.Screen(head["width"], head["height"])
    stream = pyte.Stream(screen)
    second = 1.0
    for moment, kind, data in (*events, (events[-1][0] + 1.0, "m", "")):
        while moment >= second:
            yield [
                [screen.buffer[y][x] for x in range(screen.columns)] for y in range(screen.lines)
            ]
            second += 1.0
        if kind == "o":
            stream.feed(data)


def _colour(name, default):
    return default if name == "default" else _COLOURS.get(name.removeprefix("bright"), f"#{name}")


def _look(cell):
    """Return ink, paper and weight of a cell."""
    ink, paper = _colour(cell.fg, _INK), _colour(cell.bg, _PAPER)
    return (*((paper, ink) if cell.reverse else (ink, paper)), cell.bold)


def _row(cells):
    """Return the shapes of a row whose upper left corner is the origin."""
    shapes, column = [], 0
    for (ink, paper, bold), group in itertools.groupby(cells, _look):
        text = "".join(cell.data for cell in group)
        x, width = _CELL * column, _CELL * len(text)
        column += len(text)
        if paper != _PAPER:
            shapes.append(f'<rect x="{x:.1f}" width="{width:.1f}" height="18.2" fill="{paper}"/>')
        words = text.strip()
        if words:
            x += _CELL * (len(text) - len(text.lstrip()))
            weight = ' class="b"' if bold else ""
            shapes.append(
                f'<text x="{x:.1f}" y="13.5" textLength="{_CELL * len(words):.1f}" fill="{ink}"'
                f"{weight}>{html.escape(words)}</text>"
            )
    return "".join(shapes)


def moving_svg():
    """Return the text of the picture."""
    frames = [[_row(cells) for cells in rows] for rows in _screens()]
    width = 2 * _EDGE + _CELL * len(next(_screens())[0])
    height = 2 * _EDGE + _LINE * len(frames[0])
    numbers = {row: n for n, row in enumerate(dict.fromkeys(itertools.chain(*frames)))}
    rows = "".join(f'<g id="r{n}">{row}</g>' for row, n in numbers.items() if row)
    shown, steps = [], []
    for index, (frame, again) in enumerate(zip(frames, [None, *frames], strict=False)):
        if frame != again:
            shown.append(frame)
        share = 100.0 * index / len(frames)
        steps.append(f"{share:.2f}%{{transform:translateY({-height * (len(shown) - 1):.0f}px)}}")
    uses = "".join(
        f'<use href="#r{numbers[row]}" y="{height * at + _LINE * line:.0f}"/>'
        for at, frame in enumerate(shown)
        for line, row in enumerate(frame)
        if row
    )
    still = -height * round(STILL * (len(shown) - 1))
    return (
        f'<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 {width:.0f} {height:.0f}"'
        ' role="img">\n<title>The first hour with the dashboard</title>\n'
        "<style>text{font:14px ui-monospace,Menlo,Consolas,'DejaVu Sans Mono',monospace;"
        "white-space:pre}.b{font-weight:700}"
        f"#strip{{animation:play {len(frames)}s step-end infinite}}"
        f"@keyframes play{{{''.join(steps)}}}"
        "@media(prefers-reduced-motion:reduce){#strip{animation:none;"
        f"transform:translateY({still:.0f}px)}}}}</style>\n"
        f"<defs>{rows}</defs>\n"
        f'<rect width="100%" height="100%" rx="8" fill="{_PAPER}"/>\n'
        f'<g transform="translate({_EDGE:.0f} {_EDGE:.0f})"><g id="strip">{uses}</g></g>\n</svg>\n'
    )
