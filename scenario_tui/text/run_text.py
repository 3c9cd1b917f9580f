"""One run in words: verdicts with margins and evidence, what it was, where its trace lies."""

from __future__ import annotations

import math
from collections.abc import Iterable

from rich.text import Text

from daemon.model.spec import RunResult, Snapshot
from daemon.model.status import RunDetail, RunState
from daemon.model.verdicts import Outcome, Verdict
from scenario_tui.text.formatting import (
    DASHBOARD_STYLES,
    GLYPHS,
    QUIET,
    SEVERITY,
    UNSURE,
    fine_duration,
    glyph_word,
    margin,
    margin_bar,
    pluralise,
    quantity,
    run_label,
    run_word,
    time_text,
)


def run_text(detail: RunDetail, seen: Snapshot | None) -> Text:
    """Return everything about a run, the answer first."""
    row = detail.row
    word = run_word(row)
    text = Text.assemble(
        (run_label(row), "bold"), "  ", (glyph_word(word), DASHBOARD_STYLES[word]), "\n"
    )
    if row.state is RunState.RUNNING:
        _running(text, seen)
    if row.reason:
        text.append(f"{row.reason.strip()}\n", style=UNSURE)
    text.append("\n")
    if detail.result is not None:
        _verdicts(text, detail.result)
    else:
        _oracles(text, detail)
    append_facts(text, detail)
    return text


def _running(text: Text, seen: Snapshot | None) -> None:
    if seen is None:
        text.append("waiting for its first sign of life\n", style=QUIET)
        return
    text.append(f"reached {seen.reached} of {pluralise(seen.waypoints, 'waypoint')}, ")
    text.append(f"{seen.time:.0f} s of {seen.limit:.0f} s simulated\n")


def _verdicts(text: Text, result: RunResult) -> None:
    for verdict in by_severity(result.verdicts):
        text.append(verdict_text(verdict))
        text.append("\n")
    text.append("\n")
    if result.note:
        text.append(f"{result.note}\n\n", style=UNSURE)


def by_severity(verdicts: Iterable[Verdict]) -> list[Verdict]:
    """Return verdicts, what people must look at first."""
    return sorted(verdicts, key=lambda v: SEVERITY.index(v.outcome))


def verdict_text(verdict: Verdict) -> Text:
    """Return a verdict in a few lines: margin, bar, evidence."""
    text = Text()
    text.append(f"{glyph_word(verdict.outcome)}  ", style=DASHBOARD_STYLES[verdict.outcome])
    text.append(verdict.oracle, style="bold")
    text.append(f"  {_value(verdict)}")
    first, *rest = (*_evidence_lines(verdict), "")
    if verdict.margin is not None:
        bar = margin_bar(_share(verdict))
        text.append("\n    ").append(f"{bar}  ", style=DASHBOARD_STYLES[verdict.outcome])
        text.append(first, style=QUIET)
    else:
        rest = [first, *rest]
    for line in filter(None, rest):
        text.append(f"\n    {line}", style=QUIET)
    return text


def _value(verdict: Verdict) -> str:
    if verdict.outcome is Outcome.MEASURE:
        return quantity(verdict.evidence.value, verdict.unit)
    shown = margin(verdict.margin, verdict.unit)
    if verdict.outcome is Outcome.INCONCLUSIVE and verdict.upper is not None:
        return f"{shown} to {margin(verdict.upper, verdict.unit)}"
    return shown


def _share(verdict: Verdict) -> float:
    """Return a margin as a share of the larger of value and limit, of 1 SI unit without those."""
    seen, found = verdict.evidence, verdict.margin or 0.0
    sizes = [abs(size) for size in (seen.value, seen.limit) if size is not None]
    # With a limit of zero the value is the margin: compared with that it would always be all.
    scale = max(sizes) if seen.limit and len(sizes) == 2 else 1.0
    return math.copysign(1.0, found) if math.isinf(scale) or math.isinf(found) else found / scale


def _evidence_lines(verdict: Verdict) -> list[str]:
    """Return the evidence: when and at what, then how much and what else there is to say."""
    seen = verdict.evidence
    where = ["" if seen.time is None else f"at {time_text(seen.time)}", seen.object]
    amounts = ""
    if seen.value is not None and seen.limit is not None:
        value, limit = quantity(seen.value, verdict.unit), quantity(seen.limit, verdict.unit)
        amounts = f"{value}, limit {limit}"
    lines = (where, [amounts, seen.note])
    return [", ".join(filter(None, line)) for line in lines if any(line)]


def _oracles(text: Text, detail: RunDetail) -> None:
    text.append("will be judged by\n", style=QUIET)
    for oracle in detail.spec.oracles:
        text.append(f"  {GLYPHS['measure']} {oracle.name}\n")
    text.append("\n")


def append_facts(text: Text, detail: RunDetail) -> None:
    """Add what the run was and what became of it."""
    row, spec, result = detail.row, detail.spec, detail.result
    found = [
        ("scenario", f"{spec.scenario}, repeat {spec.repeat}, seed {spec.seed}"),
        ("SUT", f"{spec.sut.name} ({spec.sut.kind})"),
        ("robot", f"{spec.robot.name}, {spec.robot.drive.kind}"),
        ("mission", f"{spec.mission.name}, {pluralise(len(spec.mission.waypoints), 'waypoint')}"),
        ("doors", f"{pluralise(len(spec.behaviours), 'behaviour')}, map shows {spec.map.doors}"),
        ("limit", f"{spec.limit:g} s simulated"),
    ]
    if result is not None:
        timing = result.timing
        speed = timing.simulated / timing.wall if timing.wall > 0 else 0.0
        found.append(("ended", result.ended))
        wall = fine_duration(timing.wall)
        found.append(("took", f"{timing.simulated:.1f} s simulated in {wall}, {speed:.0f}x"))
    if row.worker:
        found.append(("worker", f"{row.worker}, attempt {row.attempt}"))
    if row.trace:
        size = f", {result.trace.size / 1e6:.1f} MB" if result is not None else ""
        found.append(("trace", f"{row.trace}{size}"))
    for name, value in found:
        text.append(f"{name:<9}", style=QUIET)
        text.append(f" {value}\n")
