"""The first line of every screen: is it fine?"""

from __future__ import annotations

from rich.text import Text
from textual.widgets import Static

from daemon.protocol import Overview
from scenario_tui.feed import Picture
from scenario_tui.palette import GOOD, QUIET, WORDS
from scenario_tui.summary import Conclusion, overall
from scenario_tui.wording import GLYPHS, duration, rate, tally

_SHORT = {"inconclusive": "incon", "cancelled": "canc", "running": "run", "queued": "queue"}
_LEVELS = 4


class StatusLine(Static):
    """One line: connected or not, counts by word, rate, time left; shorter where it must be."""

    def show(self, picture: Picture, now: float) -> None:
        """Show what is known at wall clock time ``now``."""
        self.set_class(not picture.connected, "-gone")
        self.update(status_text(picture, now, (self.size.width or self.app.size.width - 2)))


def status_text(picture: Picture, now: float, width: int) -> Text:
    """Return the line, with full words if they fit into ``width`` cells."""
    if not picture.connected:
        return _gone(picture, now)
    overview = picture.overview
    if overview is None:
        return Text("… connecting")
    said = overall(picture.campaigns, picture.conclusions)
    for level in range(_LEVELS):
        text = _counts(overview, said, level)
        if text.cell_len <= width:
            break
    return text


def _gone(picture: Picture, now: float) -> Text:
    if not picture.problem:
        return Text("… connecting")
    if picture.at:
        age = f"no daemon answers, data is {duration(now - picture.at)} old, reconnecting"
    else:
        age = "no daemon answers, reconnecting"
    return Text.assemble(("! ", "bold"), (age, "bold"))


def _counts(overview: Overview, said: Conclusion | None, level: int) -> Text:
    """Return the line; each level is shorter, the last one has few words left."""
    short = _SHORT if level else {}
    gap = " " if level < 2 else ""
    text = Text("✓ connected" if level < 1 else "✓ up", style=GOOD)
    if said is not None:
        text.append(f"  {said.said}", style=WORDS[said.word])
    counts = tally(overview)
    for word, count in counts.items():
        name = f" {short.get(word, word)}" if level < 3 or word == "fail" else ""
        text.append(f"  {GLYPHS[word]}{gap}{count:,}{name}", style=WORDS[word])
    if not counts:
        text.append("  nothing to do", style=QUIET)
    if overview.trouble:
        text.append("  ! no run can start", style=WORDS["lost"])
    elif overview.workers == 0:
        text.append("  ! no worker", style=WORDS["lost"])
    if overview.rate > 0 and level < 2 and overview.queued + overview.running:
        text.append(f"  {rate(overview.rate)}", style="not bold")
    if overview.seconds_left is not None:
        text.append(f"  {duration(overview.seconds_left)} left", style="not bold")
    return text
