"""One run in words: verdicts with margins and evidence, settings, place of its trace."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from types import MappingProxyType
from typing import TYPE_CHECKING, Final

from rich.text import Text

from daemon.model.assessments import NO_MARK, Mark
from daemon.model.verdicts import Outcome, RunState
from grammars.text.words import count_noun, duration_text, format_quantity
from scenario_tui.text.formatting import (
    NOT_REPEATABLE,
    brief_seed,
    glyph_word,
    margin,
    margin_bar,
    margin_share,
    moment_text,
    run_word,
    time_text,
)
from scenario_tui.text.styles import GLYPHS, KNOWN, NEWS, QUIET, SEVERITY

if TYPE_CHECKING:
    from daemon.judging.assessment import Expectations
    from daemon.model.spec import MapSettings, Snapshot
    from daemon.model.status import RunDetail, RunRow
    from daemon.model.verdicts import Verdict

NO_MARKS: Final[Mapping[str, Mark]] = MappingProxyType({})
VERDICT_LINES: Final = 3
"""Lines for verdicts: the worst of them, and the counts of the others."""
_SO_FAR: Final = {
    Outcome.PASS: "passing so far",
    Outcome.INCONCLUSIVE: "undecided so far",
    Outcome.MEASURE: "so far",
}


def marked_style(word: str, mark: Mark) -> str:
    """Return the style of a verdict's word: known failures are amber."""
    return KNOWN if word == "fail" and mark.kind == "known" else word


def marked_word(row: RunRow, expectations: Expectations | None = None) -> Text:
    """Return the verdict of a run, otherwise its state, with the sign of its mark: ``✗ fail a``."""
    word = run_word(row)
    mark = NO_MARK if expectations is None else expectations.mark(row)
    return append_mark(Text.assemble((glyph_word(word), marked_style(word, mark))), mark)


def append_mark(text: Text, mark: Mark) -> Text:
    """Append the sign of a mark, if any: `` !``, `` a``; letters of known failures are amber."""
    if mark.letter:
        sign = "!" if mark.kind == "news" else ""
        text.append(f" {sign}", style=NEWS).append(mark.letter.removeprefix(sign), style=KNOWN)
    return text


def known_text(mark: Mark) -> Text:
    """Return the reason that people gave for a failure: ``a known: the door is narrow``."""
    return Text(f"{mark.letter} known: {mark.reason}".lstrip(), style=KNOWN)


def by_severity(verdicts: Iterable[Verdict], marks: Mapping[str, Mark] = NO_MARKS) -> list[Verdict]:
    """Return verdicts, the gravest first, with news before known failures."""

    def severity(verdict: Verdict) -> tuple[int, int]:
        kind = marks.get(verdict.oracle, NO_MARK).kind
        return SEVERITY.index(verdict.outcome), ("news", "", "known").index(kind)

    return sorted(verdicts, key=severity)


def verdict_text(verdict: Verdict, mark: Mark = NO_MARK, *, so_far: bool = False) -> Text:
    """Return a verdict in a few lines: margin, bar, evidence, the reason of a known failure.

    ``so_far`` means that the run goes on.
    """
    text, style = Text(), marked_style(verdict.outcome, mark)
    so_far = so_far and verdict.outcome in _SO_FAR
    word = f"{GLYPHS[verdict.outcome]} {_SO_FAR[verdict.outcome]}" if so_far else ""
    append_mark(text.append(word or glyph_word(verdict.outcome), style=style), mark)
    text.append(f"  {verdict.oracle}", style="bold")
    text.append(f"  {_value(verdict)}")
    first, *rest = (*_evidence_lines(verdict), "")
    if (share := margin_share(verdict)) is not None:
        bar = margin_bar(share)
        text.append("\n    ").append(f"{bar}  ", style=style)
        nearest = "nearest " if so_far and verdict.evidence.time is not None else ""
        text.append(f"{nearest}{first}", style=QUIET)
    else:
        rest = [first, *rest]
    for line in filter(None, rest):
        text.append(f"\n    {line}", style=QUIET)
    if mark.kind == "known":
        text.append("\n    ").append_text(known_text(mark))
    return text


def worst_text(value: float | None, unit: str, oracle: str) -> Text:
    """Return the least margin so far and its oracle: ``+0.11 m clear``; empty if unknown."""
    if value is None or not oracle:
        return Text()
    word = "fail" if value < 0.0 else "pass"
    glyph = f"{GLYPHS['fail']} " if value < 0.0 else ""
    return Text.assemble((f"{glyph}{margin(value, unit)}", word), f" {oracle}")


def _value(verdict: Verdict) -> str:
    if verdict.outcome is Outcome.MEASURE:
        return format_quantity(verdict.evidence.value, verdict.unit)
    least = margin(verdict.margin, verdict.unit)
    if verdict.outcome is Outcome.INCONCLUSIVE and verdict.upper is not None:
        return f"{least} to {margin(verdict.upper, verdict.unit)}"
    return least


def _evidence_lines(verdict: Verdict) -> list[str]:
    """Return the evidence: moment and object, then amounts and note."""
    evidence = verdict.evidence
    where = [moment_text(evidence.time), evidence.object]
    amounts = ""
    if evidence.value is not None and evidence.limit is not None:
        value = format_quantity(evidence.value, verdict.unit)
        limit = format_quantity(evidence.limit, verdict.unit)
        amounts = f"{value}, limit {limit}"
    lines = (where, [amounts, _first_line(evidence.note_text)])
    return [", ".join(filter(None, line)) for line in lines if any(line)]


def evidence_parts(verdict: Verdict) -> list[str]:
    """Return margin, moment, object and note of a verdict, as far as it has them."""
    evidence = verdict.evidence
    amount = "" if verdict.margin is None else margin(verdict.margin, verdict.unit)
    parts = (amount, moment_text(evidence.time), evidence.object, _first_line(evidence.note_text))
    return [part for part in parts if part]


def _first_line(note: str) -> str:
    # Other lines may be the output of a stack, which is printed once, with the run.
    return note.partition("\n")[0]


def verdict_lines(
    verdicts: Sequence[Verdict],
    time: float,
    most: int = VERDICT_LINES,
    marks: Mapping[str, Mark] = NO_MARKS,
) -> list[Text]:
    """Return at most ``most`` lines on the verdicts, the gravest first, with their marks.

    The line of a verdict decided after ``time`` tells how far ahead that is.
    """
    judged = [v for v in verdicts if v.outcome is not Outcome.MEASURE]
    ordered = by_severity(sorted(judged, key=lambda v: v.evidence.time or 0.0), marks)
    # Each failure has a line. All passes share one, which needs room, too.
    bad = [v for v in ordered if v.outcome is not Outcome.PASS]
    passed = len(ordered) - len(bad)
    room = most - (1 if passed or len(bad) > most else 0)
    lines = [_verdict_line(one, time, marks.get(one.oracle, NO_MARK)) for one in bad[:room]]
    rest = [f"and {len(bad) - room} more not passed"] if len(bad) > room else []
    if passed:
        rest.append(glyph_word("pass").replace("pass", f"{passed} pass"))
    if rest:
        lines.append(Text(", ".join(rest), style=QUIET if len(rest) > 1 else "pass"))
    return lines or [Text("no oracle judged this run", style=QUIET)]


def _verdict_line(verdict: Verdict, time: float, mark: Mark) -> Text:
    text = Text(no_wrap=True, overflow="ellipsis")
    text.append(glyph_word(verdict.outcome), style=marked_style(verdict.outcome, mark))
    append_mark(text, mark)
    text.append(f"  {verdict.oracle}", style="bold")
    text.append(f"  {margin(verdict.margin, verdict.unit)}")
    decided = verdict.evidence.time
    if decided is not None:
        ahead = f", {time_text(decided - time)} ahead" if decided > time + 1e-6 else ""
        text.append(f" {moment_text(decided)}{ahead}", style=QUIET)
    if verdict.evidence.object:
        text.append(f"  {verdict.evidence.object}", style=QUIET)
    if mark.kind == "known":
        text.append(f"  known: {mark.reason}", style=KNOWN)
    return text


_WITHOUT_RESULT: Final = {
    RunState.QUEUED: "has not started yet",
    RunState.LOST: "no attempt left a result",
    RunState.CANCELLED: "was cancelled before it ended",
}


def run_text(
    detail: RunDetail, snapshot: Snapshot | None, expectations: Expectations | None = None
) -> Text:
    """Return everything about a run, the answer first; ``expectations`` mark its verdicts."""
    row = detail.row
    text = Text.assemble((row.label, "bold"), "  ")
    text.append_text(marked_word(row, expectations)).append("\n")
    if row.state is RunState.RUNNING:
        _running(text, snapshot)
    elif row.state in _WITHOUT_RESULT and row.reason in ("", row.state):
        text.append(f"{_WITHOUT_RESULT[row.state]}\n", style=QUIET)
    if row.reason not in ("", row.state):
        text.append(f"{row.reason.strip()}\n", style="inconclusive")
    text.append("\n")
    if detail.row.result is not None:
        _verdicts(text, row, expectations)
    else:
        _oracles(text, detail)
    append_facts(text, detail)
    return text


def reached_text(snapshot: Snapshot | None, *, limit: bool = True) -> str:
    """Return the progress of a run: ``1/3 wp  60 s of 1200 s``; or why its start waits.

    Without ``limit`` the text ends after the simulated time.
    """
    if snapshot is None or snapshot.waiting:
        return snapshot.waiting if snapshot is not None else "starting"
    time = f"{snapshot.reached}/{snapshot.waypoints} wp  {snapshot.time:.0f} s"
    return f"{time} of {snapshot.limit:.0f} s" if limit else time


def _running(text: Text, snapshot: Snapshot | None) -> None:
    text.append(f"{reached_text(snapshot)}\n")
    if snapshot is not None:
        more = "simulated time begins once it is up" if snapshot.waiting else snapshot.stack
        text.append(f"{more}\n" if more else "", style=QUIET)


def _verdicts(text: Text, row: RunRow, expectations: Expectations | None) -> None:
    marks = NO_MARKS if expectations is None else expectations.mark_verdicts(row)
    for verdict in by_severity(row.verdicts, marks):
        text.append_text(verdict_text(verdict, marks.get(verdict.oracle, NO_MARK))).append("\n")
    text.append("\n")
    if row.result is not None and row.result.note:
        text.append(f"{row.result.note}\n\n", style="inconclusive")


def _oracles(text: Text, detail: RunDetail) -> None:
    over = detail.row.state in (RunState.LOST, RunState.CANCELLED)
    verb = "was to be judged by" if over else "will be judged by"
    text.append(f"{verb}\n", style=QUIET)
    for oracle in detail.spec.oracles:
        text.append(f"  {GLYPHS['measure']} {oracle.name}\n")
    text.append("\n")


def _map_text(settings: MapSettings) -> str:
    if settings.file:
        return f"map {settings.file[:12]} given"
    return f"map shows {settings.doors}"


def append_facts(text: Text, detail: RunDetail) -> None:
    """Append the settings of a run and the facts of its end."""
    row, spec, result = detail.row, detail.spec, detail.row.result
    repeatable = "" if spec.sut.repeatable else f", {NOT_REPEATABLE}"
    facts = [
        ("scenario", f"{spec.scenario}, repeat {spec.repeat}, seed {brief_seed(spec.seed)}"),
        ("SUT", f"{spec.sut.name} ({spec.sut.kind}{repeatable})"),
        ("robot", f"{spec.robot.name}, {spec.robot.drive.kind}"),
        ("mission", f"{spec.mission.name}, {count_noun(len(spec.mission.waypoints), 'waypoint')}"),
        ("doors", f"{count_noun(len(spec.behaviours), 'behaviour')}, {_map_text(spec.map)}"),
        ("limit", f"{spec.limit:g} s simulated"),
    ]
    if result is not None:
        timing = result.timing
        facts.append(("ended", result.ended))
        took = f"{time_text(timing.simulated)} simulated"
        # A trace alone has no wall time.
        if timing.wall > 0:
            speed = timing.simulated / timing.wall
            took += f" in {duration_text(timing.wall)}, {speed:.0f}x"
        facts.append(("took", took))
    if row.worker:
        facts.append(("worker", f"{row.worker}, attempt {row.attempt}"))
    if row.trace:
        size = f", {result.trace.size / 1e6:.1f} MB" if result is not None else ""
        facts.append(("trace", f"{row.trace}{size}"))
    for name, value in facts:
        text.append(f"{name:<9}", style=QUIET)
        text.append(f" {value}\n")
