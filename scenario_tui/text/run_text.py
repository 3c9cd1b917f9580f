"""One run in words: verdicts with margins and evidence, what it was, where its trace lies."""

from __future__ import annotations

from rich.text import Text

from daemon.model.spec import RunResult, Snapshot
from daemon.model.status import RunDetail, RunState
from scenario_tui.text.formatting import (
    DASHBOARD_STYLES,
    GLYPHS,
    Styles,
    fine_duration,
    glyph_word,
    pluralise,
    quiet_style,
    run_label,
    run_word,
)
from scenario_tui.text.verdict_text import by_severity, verdict_text


def run_text(detail: RunDetail, seen: Snapshot | None, styles: Styles = DASHBOARD_STYLES) -> Text:
    """Return everything about a run, the answer first."""
    row = detail.row
    word = run_word(row)
    text = Text.assemble((run_label(row), "bold"), "  ", (glyph_word(word), styles[word]), "\n")
    if row.state is RunState.RUNNING:
        _running(text, seen, styles)
    if row.reason:
        text.append(f"{row.reason.strip()}\n", style=styles["inconclusive"])
    text.append("\n")
    if detail.result is not None:
        _verdicts(text, detail.result, styles)
    else:
        _oracles(text, detail, styles)
    append_facts(text, detail, styles)
    return text


def _running(text: Text, seen: Snapshot | None, styles: Styles) -> None:
    if seen is None:
        text.append("waiting for its first sign of life\n", style=quiet_style(styles))
        return
    text.append(f"reached {seen.reached} of {pluralise(seen.waypoints, 'waypoint')}, ")
    text.append(f"{seen.time:.0f} s of {seen.limit:.0f} s simulated\n")


def _verdicts(text: Text, result: RunResult, styles: Styles) -> None:
    for verdict in by_severity(result.verdicts):
        text.append(verdict_text(verdict, styles))
        text.append("\n")
    text.append("\n")
    if result.note:
        text.append(f"{result.note}\n\n", style=styles["inconclusive"])


def _oracles(text: Text, detail: RunDetail, styles: Styles) -> None:
    text.append("will be judged by\n", style=quiet_style(styles))
    for oracle in detail.spec.oracles:
        text.append(f"  {GLYPHS['measure']} {oracle.name}\n")
    text.append("\n")


def append_facts(text: Text, detail: RunDetail, styles: Styles = DASHBOARD_STYLES) -> None:
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
        text.append(f"{name:<9}", style=quiet_style(styles))
        text.append(f" {value}\n")
