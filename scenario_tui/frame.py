"""One moment of a recorded run as lines of text, for terminals, scripts and the replay alike."""

from __future__ import annotations

from typing import Final

from rich.segment import Segment
from rich.style import Style
from rich.text import Text

from daemon.verdict import Outcome, Verdict
from scenario_tui.palette import QUIET, WORDS
from scenario_tui.playback import Playback
from scenario_tui.widgets.cell_view import segments
from scenario_tui.widgets.top_view import REPLAY_LEGEND, STYLES, drawn
from scenario_tui.wording import SEVERITY, counted, glyph_word, margin, moment

VERDICT_LINES: Final = 3
"""Lines for verdicts: the worst of them, and how the others are."""
_CHROME: Final = 3
"""Lines of a frame that are neither map nor verdicts: headline, timeline and legend."""


def headline(playback: Playback, time: float) -> str:
    """Return the first line: when it is, of how much, and how far the mission is."""
    done = f"reached {playback.reached(time)} of {counted(playback.waypoints, 'waypoint')}"
    state = "" if playback.trace.complete else "  (recording was cut)"
    return f"{playback.label}  {time:.1f} s of {playback.end:.1f} s  {done}{state}"


def timeline(playback: Playback, time: float, width: int) -> Text:
    """Return the whole run as a line: how far it is, and ✗ where an oracle was decided against."""
    span = max(playback.end - playback.start, 1e-9)

    def cell(at: float) -> int:
        return round((playback.within(at) - playback.start) / span * (width - 1))

    signs = ["━" if index < cell(time) else "─" for index in range(width)]
    signs[cell(time)] = "●"
    text = Text("".join(signs), style=QUIET, no_wrap=True)
    for found in playback.moments:
        at = cell(found.time)
        text = Text.assemble(text[:at], ("✗", WORDS["fail"]), text[at + 1 :])
    return text


def verdict_lines(playback: Playback, time: float, most: int = VERDICT_LINES) -> list[Text]:
    """Return at most ``most`` lines on the verdicts, what was decided against first.

    What is decided later than ``time`` is known already but said to lie ahead.
    """
    judged = [v for v in playback.verdicts if v.outcome is not Outcome.MEASURE]
    ordered = sorted(judged, key=lambda v: (SEVERITY.index(v.outcome), v.evidence.time or 0.0))
    bad = [v for v in ordered if v.outcome is not Outcome.PASS]
    passed = len(ordered) - len(bad)
    room = most - (1 if passed or len(bad) > most else 0)
    lines = [_verdict_line(verdict, time) for verdict in bad[:room]]
    rest = [f"and {len(bad) - room} more not passed"] if len(bad) > room else []
    if passed:
        rest.append(glyph_word("pass").replace("pass", f"{passed} pass"))
    if rest:
        lines.append(Text(", ".join(rest), style=QUIET if len(rest) > 1 else WORDS["pass"]))
    return lines or [Text("no oracle judged this run", style=QUIET)]


def _verdict_line(verdict: Verdict, time: float) -> Text:
    text = Text(no_wrap=True, overflow="ellipsis")
    text.append(glyph_word(verdict.outcome), style=WORDS[verdict.outcome])
    text.append(f"  {verdict.oracle}", style="bold")
    text.append(f"  {margin(verdict.margin, verdict.unit)}")
    decided = verdict.evidence.time
    if decided is not None:
        ahead = f", {decided - time:.1f} s ahead" if decided > time + 1e-6 else ""
        text.append(f" at {moment(decided)}{ahead}", style=QUIET)
    if verdict.evidence.object:
        text.append(f"  {verdict.evidence.object}", style=QUIET)
    return text


def frame(playback: Playback, time: float, width: int, height: int, *, zoom: int = 1) -> list[Text]:
    """Return the frame at ``time`` [s] as lines that fit into ``width`` x ``height`` cells."""
    verdicts = verdict_lines(playback, time)
    rows = max(3, height - _CHROME - len(verdicts))
    codes, owners = drawn(playback.view(time), width, rows, zoom=zoom).cells()
    lines = [Text(headline(playback, time), style="bold"), timeline(playback, time, width)]
    lines += [_text(segments(codes[row], owners[row], STYLES, Style())) for row in range(rows)]
    lines += [*verdicts, Text(REPLAY_LEGEND, style=QUIET)]
    for line in lines:
        line.truncate(width, overflow="ellipsis")
    return lines


def _text(parts: list[Segment]) -> Text:
    return Text.assemble(*((segment.text, segment.style or "") for segment in parts))
