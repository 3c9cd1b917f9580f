"""The first line of every screen: is it fine?"""

from __future__ import annotations

import itertools
import re
from collections.abc import Iterator
from typing import TYPE_CHECKING, Final, NamedTuple

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
    from scenario_tui.dashboard.state import Known
    from scenario_tui.text.results import Conclusion

_BRIEF: Final = {"fail": " fail", "error": " err", "lost": " lost"}
"""Words that stay behind their glyph where there is little room."""
_NAME: Final = 12
"""Characters of a campaign's name where there is little room."""
_CLAUSE: Final = re.compile(r"[?:;.](\s|$)")


class _Part(NamedTuple):
    """A part of the line in three lengths; an empty one is left out."""

    long: Text
    medium: Text
    short: Text


def _part(style: str, long: str, medium: str | None = None, short: str | None = None) -> _Part:
    """Return a part in one style; a length that is not given is as the longer one."""
    medium = long if medium is None else medium
    short = medium if short is None else short
    return _Part(Text(long, style), Text(medium, style), Text(short, style))


class StatusLine(StaticText):
    """One line: connected or not, the worst state, counts by word, time left."""

    def show(self, state: Known, now: float, *, launching: bool = False) -> None:
        """Show what is known at wall clock time ``now``; a daemon may be ``launching``."""
        # Whether one is there and busy, or none, is not known before somebody has asked.
        launching = launching and not state.connected and bool(state.problem)
        self.set_class(not state.connected and not launching, "-gone")
        width = self.size.width or self.app.size.width - 2
        self.update(Text("… starting a daemon") if launching else status_text(state, now, width))


def status_text(state: Known, now: float, width: int) -> Text:
    """Return the line that fits into ``width`` cells, its last parts shortened first."""
    parts = list(_standing(state) if state.connected else _gone(state, now))
    gap = Text("  " if state.connected else ", ")
    shown = [part.long for part in parts]
    for size, index in itertools.product((1, 2), reversed(range(len(parts)))):
        # Joining texts costs more than counting them, and the line is written ten times a second.
        if sum(text.cell_len + len(gap) for text in shown if text) - len(gap) <= width:
            break
        shown[index] = parts[index][size]
    text = gap.join(filter(None, shown))
    text.truncate(width, overflow="ellipsis")
    return text


def _gone(state: Known, now: float) -> Iterator[_Part]:
    """Say that nobody answers, or what they say instead, and how old everything else is."""
    if not state.problem:
        yield _part("", "… connecting")
        return
    if state.refused:
        # The first clause is the news; the empty screen below says the rest, and what to do.
        yield _part("bold", f"! {_CLAUSE.split(state.problem, maxsplit=1)[0]}")
    else:
        yield _part("bold", "! no daemon answers", "! no daemon")
    if state.at:
        age, short = duration_text(now - state.at), brief_duration(now - state.at)
        yield _part("bold", f"data is {age} old", f"data is {short} old", f"{short} old")
    yield _part("bold", "reconnecting", short="")


def _standing(state: Known) -> Iterator[_Part]:
    overview = state.overview
    if overview is None:
        yield _part("", "… connecting")
        return
    yield _part("pass", "✓ connected", "✓")
    yield from _troubles(overview)
    worst, judging = worst_conclusion(state.campaigns, state.conclusions), _judging(state)
    # Where nothing is judged the counts say all; nothing is as expected before all is judged.
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


def _judging(state: Known) -> int:
    """Return how many campaigns have verdicts that their conclusion does not know yet."""
    count = 0
    for row in state.campaigns:
        conclusion = state.conclusions.get(row.id)
        # Of a campaign that goes on, "so far" is said anyway.
        behind = conclusion is None or (row.finished and conclusion.verdicts < row.done)
        count += behind and row.done > 0 and not row.acknowledged and not row.search
    return count


def _worst(worst: tuple[CampaignRow, Conclusion]) -> _Part:
    """Return the state of the campaign that is worst, called by its name unless all are fine."""
    row, conclusion = worst
    glyph, name, brief = GLYPHS[conclusion.word], "", ""
    if conclusion.word not in ("pass", "running"):
        name, brief = f"{row.name}: ", f"{keep_start(row.name, _NAME)}: "
    known = f", {conclusion.known:,} known" if conclusion.known else ""
    long = f"{glyph} {name}{conclusion.text}{known}"
    return _part(conclusion.word, long, f"{glyph} {brief}{conclusion.brief}")


def _counts(overview: DaemonOverview, *, news: bool) -> Iterator[_Part]:
    """Yield how many runs have a verdict, how long the others take, and the runs by word.

    Failures are amber unless there may be ``news``: those that remain are known or acknowledged.
    """
    counts = run_counts(overview)
    if not counts:
        yield _part(QUIET, "nothing to do")
        return
    runs = overview.done + overview.lost + overview.cancelled + overview.queued + overview.running
    verdicts, of = brief_count(overview.done), brief_count(runs)
    rate = left = brief_left = ""
    if overview.queued + overview.running:
        rate = f", {rate_text(overview.rate)}" if overview.rate > 0 else ""
        if overview.seconds_left is not None:
            left = f", {duration_text(overview.seconds_left)} left"
            brief_left = f", {brief_duration(overview.seconds_left)} left"
    yield _part(
        "not bold",
        f"{count_noun(overview.done, 'verdict')} of {count_noun(runs, 'run')}{rate}{left}",
        f"{verdicts}/{of} verdicts{brief_left}",
        f"{verdicts}/{of}{brief_left}",
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
    yield _Part(Text("  ").join(long), Text(" ").join(medium), Text(" ").join(short))
