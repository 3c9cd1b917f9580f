"""The matrix of a campaign as a heat map of margins: a mark for each repeat.

The glyph of a mark shows the verdict, also without colours. A pass is a bar: the lower it is, the
nearer the run came to failing. Failures are red, known ones amber, and in reverse if they are far
beyond the limit.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Final

from rich.cells import cell_len
from rich.text import Text

from daemon.model.verdicts import Outcome
from grammars.text.words import NOTHING
from scenario_tui.text.assessment_text import leading_oracle
from scenario_tui.text.formatting import (
    brief_count,
    keep_start,
    margin,
    margin_share,
    run_word,
)
from scenario_tui.text.results import cell_margin
from scenario_tui.text.run_text import append_mark, marked_style
from scenario_tui.text.styles import GLYPHS, KNOWN, NEWS, QUIET, SEVERITY

if TYPE_CHECKING:
    from daemon.analysis.results import CampaignResults
    from daemon.model.assessments import CellAssessment
    from daemon.model.status import RunRow

_BARS: Final = "▁▂▃▄▅▆▇█"
_TIGHT: Final = 0.15
"""Share of the scale below which a pass is tight: amber instead of green."""
_DEEP: Final = -0.25
"""Share of the scale below which a failure is in reverse."""
_NARROWEST: Final = 9
"""Least columns of a system under test."""
_GAP: Final = 2
_FEWEST: Final = 6
"""Least columns of the marks of a cell beside its verdict."""
CELL_LINES: Final = 2
"""Lines of a cell: its marks with the verdict, and the most telling margin."""


@dataclass(frozen=True, slots=True)
class Heat:
    """A run in the map, with the ``word`` of its verdict or state.

    ``share`` is its least margin as a share of its scale in [-1, 1], if any; ``is_known`` marks an
    expected failure.
    """

    word: str
    share: float | None
    is_known: bool = False

    def mark(self) -> tuple[str, str]:
        """Return its glyph and its style."""
        glyph, style, share = GLYPHS[self.word], self.word, self.share
        if self.word == "pass" and share is not None:
            glyph = _BARS[min(int(max(share, 0.0) * len(_BARS)), len(_BARS) - 1)]
            style = "inconclusive" if share < _TIGHT else style
        if self.word == "fail":
            style = KNOWN if self.is_known else style
            style += ".far" if share is not None and share < _DEEP else ""
        return glyph, style


def heat_marks(cells: Sequence[CellAssessment], results: CampaignResults, width: int) -> Text:
    """Return a mark for each run of some cells.

    If they do not fit into ``width`` columns, return the number of runs for each verdict, and the
    mark of the worst run.
    """
    runs = [run for cell in cells for run in results.runs_of(cell)]
    if len(runs) <= width:
        return Text.assemble(*(_heat(run, results).mark() for run in runs))
    counts = Counter(map(run_word, runs))
    margins = (share for cell in cells if (share := cell_margin(cell)) is not None)
    worst = next((word for word in ("fail", "pass") if word in counts), "")
    is_known = results.expectations.mark_cells(cells).kind != "news"
    parts = []
    for word in sorted(counts, key=SEVERITY.index):
        share = min(margins, default=None) if word == worst else None
        glyph, style = Heat(word, share, is_known).mark()
        # The bar of a pass has no verdict of its own beside a number.
        sign = f"{GLYPHS[word]}{glyph}" if glyph != GLYPHS[word] else glyph
        parts.append(Text.assemble((sign, style), brief_count(counts[word])))
    text = Text(" ").join(parts)
    text.truncate(width, overflow="ellipsis")
    return text


def _heat(run: RunRow, results: CampaignResults) -> Heat:
    judged = (one for one in run.verdicts if one.outcome is not Outcome.MEASURE)
    shares = (share for one in judged if (share := margin_share(one)) is not None)
    is_known = results.expectations.mark(run).kind == "known"
    return Heat(run_word(run), min(shares, default=None), is_known)


def heat_lines(results: CampaignResults, width: int, height: int) -> list[Text]:
    """Return the matrix in at most ``height`` lines of ``width`` columns.

    It has a line for each scenario and a column for each system under test; ``!`` for news and the
    letters of known failures follow the marks of a cell. Scenarios and systems that do not fit
    share the last line and column, those as expected first. The last line explains the marks, if
    there is room.

    This looks at every run of the campaign: call it only after the results have changed.
    """
    cells = {(cell.scenario, cell.sut): cell for cell in results.assessment.cells}
    marks = results.expectations
    news = {place for place, cell in cells.items() if marks.mark_cells([cell]).kind == "news"}
    names = tuple(dict.fromkeys(scenario for scenario, _ in cells))
    rows = _grouped(names, height - 1, {scenario for scenario, _ in news})
    label = min(max(map(cell_len, rows), default=0), width // 3)
    columns = _grouped(
        tuple(dict.fromkeys(sut for _, sut in cells)),
        max((width - label) // (_NARROWEST + _GAP), 1),
        {sut for _, sut in news},
    )
    groups = {
        (row, column): [cells[s, u] for s in scenarios for u in suts if (s, u) in cells]
        for row, scenarios in rows.items()
        for column, suts in columns.items()
    }
    # Columns are as narrow as the marks, so that neighbours are read together.
    room = (width - label) // max(len(columns), 1) - _GAP
    longest = max((sum(len(cell.runs) for cell in group) for group in groups.values()), default=0)
    room = max(min(room, max(longest + 2, *map(cell_len, columns), _NARROWEST)), 1)
    lines = [_line("", [Text(one, QUIET) for one in columns], label, room)]
    for row in rows:
        texts = []
        for column in columns:
            group = groups[row, column]
            mark = marks.mark_cells(group)
            text = heat_marks(group, results, max(room - len(mark.letter) - 1, 1))
            texts.append(append_mark(text, mark))
        lines.append(_line(row, texts, label, room))
    if len(lines) < height:
        lines.append(heat_legend(results))
        lines[-1].truncate(width, overflow="ellipsis")
    return lines[:height]


def heat_cell(cell: CellAssessment | None, results: CampaignResults, width: int) -> Text:
    """Return a cell of the matrix in two lines of at most ``width`` columns.

    The first line has the marks, ``!`` for news, the letters of known failures, the verdict and the
    share of passed repeats. The second one has the most telling margin. ``None`` is a cell without
    runs.
    """
    if cell is None:
        return Text(NOTHING, style=QUIET)
    # The marks are the glyphs of this word.
    word, mark = cell.word, results.expectations.mark_cells([cell])
    text = heat_marks([cell], results, max(width - len(mark.letter) - 2 - len(word), _FEWEST))
    append_mark(text, mark).append(f" {word}", style=marked_style(word, mark))
    runs = results.runs_of(cell)
    share = f" {sum(run.outcome is Outcome.PASS for run in runs)}/{len(runs)}"
    text.append(share if text.cell_len + len(share) <= width else "")
    text.truncate(width, overflow="ellipsis")
    oracle = leading_oracle(cell)
    if oracle is not None and oracle.worst is not None:
        least = margin(oracle.worst.verdict.margin, oracle.worst.verdict.unit)
        name = keep_start(oracle.oracle, max(width - len(least) - 1, 1))
        text.append(f"\n{least} {name}", style=QUIET)
    return text


def _grouped(names: Sequence[str], most: int, first: set[str]) -> dict[str, tuple[str, ...]]:
    """Return at most ``most`` groups of names by title: single names, then all others."""
    if len(names) <= most:
        return {name: (name,) for name in names}
    single = set(sorted(names, key=lambda name: name not in first)[: max(most - 1, 0)])
    rest = tuple(name for name in names if name not in single)
    title = f"{len(rest)} more" if single else f"all {len(rest)}"
    return {name: (name,) for name in names if name in single} | {title: rest}


def _line(label: str, cells: Sequence[Text], width: int, room: int) -> Text:
    text = Text(no_wrap=True, overflow="ellipsis")
    for cell, columns in ((Text(label), width), *((cell, room) for cell in cells)):
        cell.truncate(columns, overflow="ellipsis", pad=True)
        text.append_text(cell).append(" " * _GAP)
    text.rstrip()
    return text


def heat_legend(results: CampaignResults) -> Text:
    """Return the legend of the marks."""
    text = Text(no_wrap=True, overflow="ellipsis")
    if results.row.passed:
        text.append(_BARS[0], style="inconclusive").append(" tight ", style=QUIET)
        text.append(_BARS[-1], style="pass").append(" clear pass  ", style=QUIET)
    text.append("!", style=NEWS).append(" unexpected", style=QUIET)
    if results.expectations.failures:
        text.append("  a", style=KNOWN).append(" known", style=QUIET)
    return text
