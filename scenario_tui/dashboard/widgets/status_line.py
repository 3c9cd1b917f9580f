"""The first line of every screen: is it fine?"""

from __future__ import annotations

import re
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Final

from rich.text import Text

from grammars.text.words import duration_text
from scenario_tui.dashboard.widgets.static_text import StaticText
from scenario_tui.text.formatting import (
    DASHBOARD_STYLES,
    GLYPHS,
    GOOD,
    QUIET,
    UNSURE,
    brief_count,
    brief_duration,
    rate_text,
    run_counts,
)
from scenario_tui.text.results import worst_conclusion

if TYPE_CHECKING:
    from daemon.model.status import CampaignRow, DaemonOverview, Preparation
    from scenario_tui.dashboard.state import DashboardState

_SHORT: Final = {"inconclusive": "incon", "cancelled": "canc", "running": "run", "queued": "queue"}
_LAST: Final = 3
"""The level of the shortest forms."""
_SPARE: Final = 2
"""Parts worth no more than this give way before others lose their words."""
# What has to be looked at stays longest, what went well is the first of the counts to go.
_KEEP: Final = {"fail": 8, "error": 7, "lost": 7, "running": 6, "queued": 6, "inconclusive": 5,
                "pass": 4, "cancelled": 1}  # fmt: skip
_CLAUSE: Final = re.compile(r"[?:;.](\s|$)")


@dataclass(frozen=True, slots=True)
class _Part:
    """A part of the line, from its longest form to its shortest; more ``keep`` stays longer."""

    forms: tuple[str, ...]
    style: str
    keep: int

    def form(self, level: int) -> str:
        return self.forms[min(level, len(self.forms) - 1)]


class StatusLine(StaticText):
    """One line: connected or not, counts by word, rate, time left; shorter where it must be."""

    def show(self, state: DashboardState, now: float, *, launching: bool = False) -> None:
        """Show what is known at wall clock time ``now``; a daemon may be ``launching``."""
        # Whether one is there and busy, or none, is not known before somebody has asked.
        launching = launching and not state.connected and bool(state.problem)
        self.set_class(not state.connected and not launching, "-gone")
        width = self.size.width or self.app.size.width - 2
        self.update(Text("… starting a daemon") if launching else status_text(state, now, width))


def status_text(state: DashboardState, now: float, width: int) -> Text:
    """Return the line with as many words as fit into ``width`` cells, what matters most first."""
    parts = list(_standing(state) if state.connected else _gone(state, now))
    for text in _shortenings(parts, "  " if state.connected else ", "):
        if text.cell_len <= width:
            return text
    text.truncate(width, overflow="ellipsis")
    return text


def _shortenings(parts: Sequence[_Part], gap: str) -> Iterator[Text]:
    """Return the line ever shorter: shorter words, then fewer, at last the first part alone."""
    levels = dict.fromkeys(parts, 0)
    for level in range(_LAST):
        levels = dict.fromkeys(parts, level)
        yield _joined(levels, gap)
    # First all words get shorter together, level by level; then, part by part, those of least
    # weight, from the right; at last parts go.
    tight = gap.replace("  ", " ")
    yield _joined(levels, tight)
    order = {part: place for place, part in enumerate(parts)}
    by_weight = sorted(parts, key=lambda part: (part.keep, -order[part]))
    for part in by_weight:
        if part.keep <= _SPARE:
            del levels[part]
        else:
            levels[part] = _LAST
        yield _joined(levels, tight)
    for part in by_weight:
        if part in levels and len(levels) > 1:
            del levels[part]
            yield _joined(levels, tight)


def _joined(levels: Mapping[_Part, int], gap: str) -> Text:
    texts = (Text(part.form(level), style=part.style) for part, level in levels.items())
    return Text(gap).join(texts)


def _gone(state: DashboardState, now: float) -> Iterator[_Part]:
    """Say that nobody answers, or what they say instead, and how old everything else is."""
    if not state.problem:
        yield _Part(("… connecting",), "", 9)
        return
    if state.refused:
        # The first clause is the news; the empty screen below says the rest, and what to do.
        said = _CLAUSE.split(state.problem, maxsplit=1)[0]
        yield _Part((f"! {said}",), "bold", 9)
    else:
        yield _Part(("! no daemon answers", "! no daemon"), "bold", 9)
    if state.at:
        age = duration_text(now - state.at)
        short = brief_duration(now - state.at)
        yield _Part((f"data is {age} old", f"data {short} old", f"{short} old"), "bold", 8)
    yield _Part(("reconnecting",), "bold", 1)


def _standing(state: DashboardState) -> Iterator[_Part]:
    overview = state.overview
    if overview is None:
        yield _Part(("… connecting",), "", 9)
        return
    yield _Part(("✓ connected", "✓ up", "✓ up", "✓"), GOOD, 9)
    yield from _troubles(overview)
    worst = worst_conclusion(state.campaigns, state.conclusions)
    # Where nothing is judged the counts say all.
    if worst is not None and worst[1].is_judged:
        said = worst[1]
        keep = 8 if said.unexpected else 3
        yield _Part((said.glyph_text,), DASHBOARD_STYLES[said.word], keep)
    counts = run_counts(overview)
    for word, count in counts.items():
        yield _Part(_counted(word, count), DASHBOARD_STYLES[word], _KEEP[word])
    if not counts:
        yield _Part(("nothing to do",), QUIET, 4)
    if waits := _paused(state.campaigns):
        yield _Part((waits,), UNSURE, 6)
    yield from _pace(overview)


def _troubles(overview: DaemonOverview) -> Iterator[_Part]:
    if overview.trouble:
        yield _Part(("! no run can start", "! no run can start", "! no run starts"),
                    DASHBOARD_STYLES["lost"], 9)  # fmt: skip
    elif overview.troubles:
        count = len(overview.troubles)
        words = f"! {count} trouble{'s' if count > 1 else ''}"
        yield _Part((words, words, f"! {count}"), DASHBOARD_STYLES["lost"], 8)
    elif overview.workers == 0 and overview.preparation is None:
        yield _Part(("! no worker",), DASHBOARD_STYLES["lost"], 8)
    if overview.preparation is not None:
        yield _Part((overview.preparing, *_brief_preparation(overview.preparation)), QUIET, 7)


def _brief_preparation(preparation: Preparation) -> tuple[str, str]:
    """Return what a worker prepares in few words, and in one or two."""
    from daemon.model.status import PreparationPhase  # loaded with the answer that has it

    match preparation.phase:
        case PreparationPhase.STARTING:
            return "loading the simulator", "… starting"
        case PreparationPhase.COMPILING:
            return f"compiling kernels: {preparation.done}", f"… {preparation.done} kernels"


def _counted(word: str, count: int) -> tuple[str, ...]:
    glyph, short = GLYPHS[word], _SHORT.get(word, word)
    tight = f"{glyph}{count:,} {short}"
    last = f"{glyph}{brief_count(count)}"
    return (
        f"{glyph} {count:,} {word}",
        f"{glyph} {count:,} {short}",
        tight,
        f"{last} {short}" if word == "fail" else last,
    )


def _paused(campaigns: Sequence[CampaignRow]) -> str:
    """Say when everything that waits is held back on purpose."""
    waiting = [row for row in campaigns if row.queued]
    return "‖ paused" if waiting and all(row.paused for row in waiting) else ""


def _pace(overview: DaemonOverview) -> Iterator[_Part]:
    if not overview.queued + overview.running:
        return
    if overview.rate > 0:
        said = rate_text(overview.rate)
        yield _Part((said, said, said.replace(" runs", "")), "not bold", 2)
    if overview.seconds_left is not None:
        left = duration_text(overview.seconds_left)
        brief = brief_duration(overview.seconds_left)
        yield _Part((f"{left} left", f"{left} left", f"{left} left", f"{brief} left"),
                    "not bold", 6)  # fmt: skip
