"""Words and numbers for people: command line, dashboard and report alike.

Simulated time is in tenths of a second (:func:`time_text`); spans of wall time are in words
(``3 min 20 s``, or ``3 min`` where there is little room).
"""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, Final, Literal

from daemon.model.verdicts import Outcome, Verdict
from grammars.text.terminal_text import printable, without_escapes
from grammars.text.words import NOTHING, duration_text, format_quantity
from scenario_tui.text.styles import GLYPHS

if TYPE_CHECKING:
    from rich.table import Table

    from daemon.model.status import CampaignRow, DaemonOverview, RunRow

_SEED_DIGITS: Final = 6
SHOWN_LINES: Final = 40
"""Default number of last lines of a program's output to show."""
NOT_REPEATABLE: Final = "not repeatable"
"""Words for an external system under test: the same run gives another result each time."""


def run_word(row: RunRow) -> str:
    """Return the verdict of a run, otherwise its state."""
    # The module of RunState.DONE loads four times as long as this one.
    if row.state == "done":
        return str(row.outcome or Outcome.ERROR)
    return str(row.state)


def glyph_word(word: str) -> str:
    """Return ``✓ pass`` for ``pass``."""
    return f"{GLYPHS[word]} {word}"


def keep_start(text: str, width: int) -> str:
    """Return a text of at most ``width`` characters, cut at its end."""
    return text if len(text) <= width else f"{text[: width - 1]}…"


def keep_end(text: str, width: int) -> str:
    """Return a text of ``width`` characters: padded, or cut at its start."""
    return f"{text:<{width}}" if len(text) <= width else f"…{text[len(text) - width + 1 :]}"


def brief_seed(seed: int) -> str:
    """Return the first digits of a seed, enough to tell two apart."""
    digits = str(seed)
    return digits if len(digits) <= _SEED_DIGITS + 2 else f"{digits[:_SEED_DIGITS]}…"


def margin(value: float | None, unit: str) -> str:
    """Return a signed margin with its unit; ``–`` for ``None``."""
    return format_quantity(value, unit, signed=True)


def margin_bar(share: float, half: int = 4) -> str:
    """Return a bar that grows from the middle: left for a broken limit, right for a kept one.

    ``share`` is cut to [-1, 1]. Every side has ``half`` cells in steps of half a cell; a share
    other than 0 has at least one step.
    """
    filled = 0.0 if math.isnan(share) else min(abs(share), 1.0)
    steps = math.ceil(2 * half * filled)
    full, rest = divmod(steps, 2)
    if share < 0:
        return f"{'▐' * rest + '█' * full:>{half}}│{'':{half}}"
    return f"{'':{half}}│{'█' * full + '▌' * rest:<{half}}"


def margin_share(verdict: Verdict) -> float | None:
    """Return a margin as a share in [-1, 1] of the larger of value and limit, ``None`` without one.

    Without these, or with a limit of 0, it is a share of 1 SI unit.
    """
    evidence, size = verdict.evidence, verdict.margin
    if size is None:
        return None
    sizes = [abs(one) for one in (evidence.value, evidence.limit) if one is not None]
    # With a limit of zero the value is the margin: the share would always be 1.
    scale = max(sizes) if evidence.limit and len(sizes) == 2 else 1.0
    is_unbounded = math.isinf(scale) or math.isinf(size)
    return math.copysign(1.0, size) if is_unbounded else max(-1.0, min(1.0, size / scale))


def time_text(seconds: float | None) -> str:
    """Return a moment of simulated time: ``312.4 s``."""
    return NOTHING if seconds is None else f"{seconds:.1f} s"


def moment_text(seconds: float | None) -> str:
    """Return ``at 312.4 s``, nothing for no moment."""
    return "" if seconds is None else f"at {time_text(seconds)}"


def brief_duration(seconds: float) -> str:
    """Return a span of wall time in one unit, where there is little room: ``12 min``, ``3 h``."""
    return " ".join(duration_text(seconds).split()[:2])


def brief_count(number: int) -> str:
    """Return a count where there is little room: ``9,999``, ``12k``, ``3M``."""
    if number < 10_000:
        return f"{number:,}"
    return f"{number // 1000}k" if number < 1_000_000 else f"{number // 1_000_000}M"


def age_text(then: float, now: float) -> str:
    """Return how long ago something was, in one unit: ``12 s ago``, ``25 h ago``."""
    return f"{brief_duration(now - then)} ago"


def rate_text(per_minute: float) -> str:
    """Return a rate of runs: ``12.5 runs/min``."""
    return f"{per_minute:.3g} runs/min" if per_minute > 0 else NOTHING


def run_counts(row: CampaignRow | DaemonOverview) -> dict[str, int]:
    """Return the number of runs for each word, the most important first."""
    counts = {
        "fail": row.failed,
        "error": row.errors,
        "lost": row.lost,
        "inconclusive": row.inconclusive,
        "pass": row.passed,
        "cancelled": row.cancelled,
        "running": row.running,
        "queued": row.queued,
    }
    return {word: count for word, count in counts.items() if count}


def verdict_line(verdict: Verdict) -> str:
    """Return a verdict and its evidence: ``no-collision: −0.03 m at 512.0 s, door_3``."""
    evidence = verdict.evidence
    result = f"{verdict.oracle}: {margin(verdict.margin, verdict.unit)}"
    first = " ".join(filter(None, (result, moment_text(evidence.time))))
    return ", ".join(filter(None, (first, evidence.object, evidence.note_text)))


def printed_lines(text: str) -> list[str]:
    """Return the lines of a program's output as a terminal shows them, without colours.

    A line that was overwritten, as by a progress bar, has its last text.
    """
    plain = without_escapes(text).replace("\r\n", "\n")
    lines = [line.rstrip("\r").rpartition("\r")[2] for line in plain.split("\n")]
    while lines and not lines[-1].strip():
        lines.pop()
    return [printable(line.expandtabs()) for line in lines]


def last_lines(text: str, most: int | None = SHOWN_LINES) -> tuple[list[str], int]:
    """Return the last ``most`` lines of an output, or all, and the number of lines before."""
    lines = printed_lines(text)
    hidden = 0 if most is None else max(0, len(lines) - most)
    return lines[hidden:], hidden


def plain_table(*titles: str, figures: bool = False) -> Table:
    """Return a table without lines; with ``figures`` all columns but the first align right."""
    from rich import box
    from rich.table import Table

    # Folded, never cut: scripts and people look for whole names.
    table = Table(box=box.SIMPLE_HEAD, pad_edge=False, show_edge=False)
    for index, title in enumerate(titles):
        side: Literal["left", "right"] = "right" if figures and index else "left"
        table.add_column(title, overflow="fold", justify=side)
    return table
