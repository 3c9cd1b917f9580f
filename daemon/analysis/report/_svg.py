"""Figures as small SVG: matplotlib's drawing, its colours turned into those of the page.

What a figure is drawn with are the colours of :data:`INK` and its like; the page gives each a
value in light and dark, so figures follow the theme of the reader.
"""

from __future__ import annotations

import io
import re
import warnings
from typing import TYPE_CHECKING, Any, Final
from xml.sax.saxutils import escape

from templates.naming import xml_text

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

INK: Final = "#1b1f24"
SOFT: Final = "#66707b"
RULE: Final = "#d5dadf"
WALL: Final = "#8a929b"
LINE: Final = "#1f6fb2"
SECOND: Final = "#b4581f"
BAD: Final = "#c62f2f"
NEAR: Final = "#e08a1e"
GOOD: Final = "#2b8a5f"
BODY: Final = "#4a6b8a"
SERIES: Final = (
    "#1f6fb3", "#cc5a12", "#14806a", "#a04b9c", "#b08a00", "#3d9bd6", "#7a5fc4", "#7d7d7d",
)  # fmt: skip
"""Colours of scenarios or systems under test side by side, in this order."""

_VARIABLES: Final = {
    INK: "ink", SOFT: "soft", RULE: "rule", WALL: "wall", LINE: "line", SECOND: "second",
    BAD: "bad", NEAR: "near", GOOD: "good", BODY: "body",
    **{colour: f"s{number}" for number, colour in enumerate(SERIES)},
}  # fmt: skip
_COLOUR: Final = re.compile("|".join(_VARIABLES))
_STYLE: Final[dict[Any, Any]] = {
    "svg.fonttype": "none",
    "svg.image_inline": True,
    "font.family": "sans-serif",
    "font.size": 7.5,
    "axes.edgecolor": RULE,
    "axes.labelcolor": SOFT,
    "axes.titlecolor": INK,
    "axes.titlesize": 8.0,
    "axes.labelsize": 7.5,
    "axes.linewidth": 0.8,
    "axes.grid": True,
    "axes.axisbelow": True,
    "axes.spines.top": False,
    "axes.spines.right": False,
    "grid.color": RULE,
    "grid.linewidth": 0.5,
    "xtick.color": SOFT,
    "ytick.color": SOFT,
    "xtick.labelsize": 7.0,
    "ytick.labelsize": 7.0,
    "xtick.major.size": 0.0,
    "ytick.major.size": 0.0,
    "text.color": INK,
    "legend.frameon": False,
    "legend.fontsize": 7.0,
    "path.simplify": True,
    "path.simplify_threshold": 0.3,
    "lines.solid_joinstyle": "round",
    "lines.solid_capstyle": "round",
    "figure.facecolor": "none",
    "axes.facecolor": "none",
    "savefig.facecolor": "none",
}
_NUMBER: Final = re.compile(r"-?\d+\.\d+")
_PATH_DATA: Final = re.compile(r' d="([^"]*)"')
# Nothing refers to these groups of matplotlib's (3.11); clips, markers and images are referred to.
_UNUSED_IDS: Final = re.compile(
    r' id="(?:figure|axes|patch|line2d|text|matplotlib\.axis|xtick|ytick'
    r"|PathCollection|LineCollection|PolyCollection|FillBetween\w*|legend"
    r'|QuadMesh|image\w*)_?\w*"'
)
_FONT: Final = re.compile(r"font: (?:(bold|\d+) )?([\d.]+)px [^;\"]*")
_REFERENCE: Final = re.compile(r'(id="|url\(#|href="#)([mpi][0-9a-f]+|image[0-9a-f]+)')


_QUOTE: Final = {'"': "&quot;"}
_LEFT, _RIGHT, _TOP, _BOTTOM = 0.36, 0.12, 0.2, 0.34
"""Room around axes for their words [inches]."""


def new_figure(
    width: float,
    height: float,
    rows: int = 1,
    columns: int = 1,
    *,
    bare: bool = False,
    **options: Any,
) -> tuple[Figure, Any]:
    """Return a matplotlib figure [inches] and its axes, styled for the page.

    ``bare`` axes have no words around them.
    """
    import matplotlib
    from matplotlib.figure import Figure

    with matplotlib.rc_context(_STYLE):
        # Not by pyplot, which keeps every figure and is made for one thread and a screen.
        sheet = Figure(figsize=(width, height))
        axes = sheet.subplots(rows, columns, **options)
    left, right, top, bottom = (0.02,) * 4 if bare else (_LEFT, _RIGHT, _TOP, _BOTTOM)
    # A layout engine would draw everything twice to find out as much.
    sheet.subplots_adjust(
        left=left / width,
        right=1.0 - right / width,
        top=1.0 - top / height,
        bottom=bottom / height,
        hspace=0.34,
        wspace=0.2,
    )
    return sheet, axes


def to_svg(sheet: Figure, name: str, label: str) -> str:
    """Return ``sheet`` as an ``<svg>`` element to stand inside of a page.

    ``name`` keeps its identifiers apart from those of other figures; ``label`` is read out where
    pictures are not seen and must be plain text.
    """
    import matplotlib

    buffer = io.StringIO()
    nothing = dict.fromkeys(("Date", "Creator", "Format", "Type"))
    # The salt makes identifiers the same in every report: same traces, same bytes.
    with matplotlib.rc_context(_STYLE | {"svg.hashsalt": name}), warnings.catch_warnings():
        # Words stay words: the reader's fonts show what matplotlib's lack.
        warnings.filterwarnings("ignore", "Glyph .* missing from font")
        sheet.savefig(buffer, format="svg", metadata=nothing)
    return _clean_svg(buffer.getvalue(), name, label)


def _clean_svg(text: str, name: str, label: str) -> str:
    text = text[text.index("<svg") :]
    text = re.sub(r"<!--.*?-->\s*", "", text, flags=re.S)
    text = re.sub(r"<metadata>.*?</metadata>\s*", "", text, flags=re.S)
    text = _UNUSED_IDS.sub("", text)
    text = _REFERENCE.sub(rf"\1{name}-\2", text)
    text = _FONT.sub(_font, text)
    text = _PATH_DATA.sub(lambda found: f' d="{_shorten_path(found[1])}"', text)
    text = _COLOUR.sub(lambda found: f"var(--{_VARIABLES[found[0]]})", text)
    text = re.sub(r">\s+<", "><", text)
    size = re.match(r"<svg[^>]*viewBox=\"([^\"]*)\"[^>]*>", text)
    if size is None:
        raise ValueError("matplotlib wrote an SVG without a view box")
    head = (
        f'<svg viewBox="{size[1]}" role="img" aria-label="{escape(xml_text(label), _QUOTE)}" '
        'xmlns="http://www.w3.org/2000/svg" xmlns:xlink="http://www.w3.org/1999/xlink">'
    )
    return head + text[size.end() :].strip()


def _font(found: re.Match[str]) -> str:
    weight = f"font-weight: {found[1]}; " if found[1] else ""
    return f"{weight}font-size: {found[2]}px"


def _shorten_path(path: str) -> str:
    rounded = _NUMBER.sub(lambda n: f"{float(n[0]):.1f}".removesuffix(".0"), path)
    return rounded.replace("\n", " ").replace("  ", " ").replace(" z", "z").strip()


def escape_mathtext(text: str) -> str:
    """Return ``text`` so that matplotlib shows it as it is, formulas included."""
    return xml_text(text).replace("$", r"\$")


def title_axes(axes: Axes, words: str) -> None:
    """Say above ``axes`` what they show: easier to read than words that stand on end."""
    axes.set_title(words, loc="left", color=SOFT, fontsize=7.5, pad=3.0)


def add_legend(axes: Axes, **options: Any) -> None:
    """Put a legend above ``axes``, in one row on the right."""
    axes.legend(
        loc="lower right",
        bbox_to_anchor=(1.0, 0.99),
        ncols=5,
        borderaxespad=0.0,
        borderpad=0.1,
        handlelength=1.2,
        handletextpad=0.4,
        columnspacing=0.9,
        frameon=False,
        fontsize=7.0,
        labelcolor=SOFT,
        **options,
    )
