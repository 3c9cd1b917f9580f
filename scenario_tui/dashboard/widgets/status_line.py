"""The first line of every screen: connection, worst state, counts, time left."""

from __future__ import annotations

import itertools
import re
from collections.abc import Iterator
from typing import TYPE_CHECKING, Final, TypeAlias

from rich.text import Text

from grammars.text.words import count_noun, duration_text
from scenario_tui.dashboard.state import CAMPAIGNS_SHOWN
from scenario_tui.dashboard.widgets.static_text import StaticText
from scenario_tui.text.formatting import (
    brief_count,
    brief_duration,
    keep_start,
    rate_text,
    run_counts,
)
from scenario_tui.text.results import worst_conclusion
from scenario_tui.text.styles import GLYPHS, KNOWN, QUIET

if TYPE_CHECKING:
    from daemon.model.status import CampaignRow, DaemonOverview
    from scenario_tui.dashboard.state import DashboardState
    from scenario_tui.text.results import Conclusion

_BRIEF: Final = {"fail": " fail", "error": " err", "lost": " lost"}
"""Words that stay behind their glyph in a short line."""
_NAME: Final = 12
"""Characters of a campaign's name in a short line."""
_CLAUSE: Final = re.compile(r"[?:;.](\s|$)")


_Part: TypeAlias = tuple[Text, Text, Text]
"""A part of the line in three lengths, the longest first; an empty one is left out."""


def _part(style: str, long: str, medium: str | None = None, short: str | None = None) -> _Part:
    """Return a part in one style; a missing length is the next longer one."""
    medium = long if medium is None else medium
    short = medium if short is None else short
    return Text(long, style), Text(medium, style), Text(short, style)


class StatusLine(StaticText):
    """One line: connected or not, the worst state, counts by word, time left."""

    def show(self, state: DashboardState, now: float, *, launching: bool = False) -> None:
        """Show the state at wall clock time ``now``; a daemon may be ``launching``."""
        # Before the first request it is unknown whether a daemon exists.
        launching = launching and not state.connected and bool(state.problem)
        self.set_class(not state.connected and not launching, "-gone")
        width = self.size.width or self.app.size.width - 2
        self.update(Text("… starting a daemon") if launching else status_text(state, now, width))


def status_text(state: DashboardState, now: float, width: int) -> Text:
    """Return the line that fits into ``width`` cells, its last parts shortened first."""
    parts = list(_standing(state) if state.connected else _gone(state, now))
    gap = Text("  " if state.connected else ", ")
    texts = [part[0] for part in parts]
    for size, index in itertools.product((1, 2), reversed(range(len(parts)))):
        # Joining texts costs more than counting them, and the line is written ten times a second.
        if sum(text.cell_len + len(gap) for text in texts if text) - len(gap) <= width:
            break
        texts[index] = parts[index][size]
    text = gap.join(filter(None, texts))
    text.truncate(width, overflow="ellipsis")
    return text


def _gone(state: DashboardState, now: float) -> Iterator[_Part]:
    """Yield the reason why the daemon is not connected, and the age of the data."""
    if not state.problem:
        yield _part("", "… connecting")
        return
    if state.refused:
        # The first clause only; the empty screen below has the rest, and the remedy.
        yield _part("bold", f"! {_CLAUSE.split(state.problem, maxsplit=1)[0]}")
    else:
        yield _part("bold", "! no daemon answers", "! no daemon")
    if state.at:
        age, short = duration_text(now - state.at), brief_duration(now - state.at)
        yield _part("bold", f"data is {age} old", f"data is {short} old", f"{short} old")
    yield _part("bold", "reconnecting", short="")


def _standing(state: DashboardState) -> Iterator[_Part]:
    overview = state.overview
    if overview is None:
        yield _part("", "… connecting")
        return
    yield _part("pass", "✓ connected", "✓")
    yield from _troubles(overview)
    worst, judging = worst_conclusion(state.campaigns, state.conclusions), _judging(state)
    # Without a verdict the counts are enough, and nothing is "as expected" before all is judged.
    if worst is not None and worst[1].is_judged and not (judging and worst[1].word == "pass"):
        yield _worst(worst)
    if worst is None and not judging and any(row.acknowledged for row in state.campaigns):
        yield _part(QUIET, "nothing new")
    if overview.campaigns > CAMPAIGNS_SHOWN:
        newest = f"of the newest {CAMPAIGNS_SHOWN}"
        yield _part(QUIET, f"{newest} campaigns", newest, "")
    if judging:
        yield _part(QUIET, f"… judging {count_noun(judging, 'campaign')}", "… judging")
    news = judging > 0 or (worst is not None and worst[1].word not in ("pass", "running"))
    yield from _counts(overview, news=news)
    waiting = [row for row in state.campaigns if row.queued]
    if waiting and all(row.paused for row in waiting):
        yield _part("inconclusive", "‖ paused")


def _troubles(overview: DaemonOverview) -> Iterator[_Part]:
    style = "lost"
    if overview.trouble:
        yield _part(style, "! no run can start")
    elif overview.troubles:
        words = f"! {count_noun(len(overview.troubles), 'trouble')}"
        yield _part(style, words)
    elif overview.workers == 0 and overview.preparation is None:
        yield _part(style, "! no worker")
    if overview.preparation is not None:
        kernels = overview.preparation.done
        brief = f"… {kernels} kernels" if kernels else "… starting"
        yield _part(QUIET, overview.preparing, brief)


def _judging(state: DashboardState) -> int:
    """Return the number of campaigns with verdicts that are not in their conclusion yet."""
    count = 0
    for row in state.campaigns:
        conclusion = state.conclusions.get(row.id)
        # The conclusion of an unfinished campaign is preliminary anyway.
        behind = conclusion is None or (row.finished and conclusion.verdicts < row.done)
        count += behind and row.done > 0 and not row.acknowledged and not row.search
    return count


def _worst(worst: tuple[CampaignRow, Conclusion]) -> _Part:
    """Return the state of the worst campaign, with its name unless all are fine."""
    row, conclusion = worst
    glyph, name, brief = GLYPHS[conclusion.word], "", ""
    if conclusion.word not in ("pass", "running"):
        name, brief = f"{row.name}: ", f"{keep_start(row.name, _NAME)}: "
    expected = f", {conclusion.known:,} known" if conclusion.known else ""
    long = f"{glyph} {name}{conclusion.text}{expected}"
    return _part(conclusion.word, long, f"{glyph} {brief}{conclusion.brief}")


def _counts(overview: DaemonOverview, *, news: bool) -> Iterator[_Part]:
    """Yield the number of judged runs, the time left, and the number of runs by word.

    Failures are amber unless some may be ``news``: the others are known or acknowledged.
    """
    counts = run_counts(overview)
    if not counts:
        yield _part(QUIET, "nothing to do")
        return
    runs = overview.done + overview.lost + overview.cancelled + overview.queued + overview.running
    verdicts, of = brief_count(overview.done), brief_count(runs)
    rate = rest = brief_rest = ""
    if overview.queued + overview.running:
        rate = f", {rate_text(overview.rate)}" if overview.rate > 0 else ""
        if overview.seconds_left is not None:
            rest = f", {duration_text(overview.seconds_left)} left"
            brief_rest = f", {brief_duration(overview.seconds_left)} left"
    yield _part(
        "not bold",
        f"{count_noun(overview.done, 'verdict')} of {count_noun(runs, 'run')}{rate}{rest}",
        f"{verdicts}/{of} verdicts{brief_rest}",
        f"{verdicts}/{of}{brief_rest}",
    )
    if overview.searched:
        words = f"{overview.searched:,} found by searches"
        yield _part(QUIET, words, f"{brief_count(overview.searched)} found", "")
    long, medium, short = [], [], []
    for word, count in counts.items():
        style = KNOWN if word == "fail" and not news else word
        glyph = GLYPHS[word]
        brief = Text(f"{glyph}{brief_count(count)}{_BRIEF.get(word, '')}", style)
        long.append(Text(f"{glyph} {count:,} {word}", style))
        medium += [brief] if word != "cancelled" else []
        short += [brief] if word not in ("cancelled", "pass") else []
    yield Text("  ").join(long), Text(" ").join(medium), Text(" ").join(short)
