"""The report as a page: its content, order and words.

A page is a function of its data, without clocks and folders. Unknown facts are left out.
"""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Callable, Iterable, Iterator, Sequence
from datetime import UTC, datetime
from pathlib import Path
from statistics import fmean, stdev
from typing import Any, Final, Literal, TypeAlias

from daemon.analysis.charts import page_script
from daemon.analysis.report._data import ReportData, ReportRun, measure_columns
from daemon.analysis.report._figures import (
    FIGURE_KINDS,
    MOST_CELLS,
    draw_figures,
    largest_errors,
    notable_verdicts,
    write_figures,
)
from daemon.analysis.report.run_maps import draw_building
from daemon.analysis.results import CampaignResults
from daemon.judging.assessment import severity
from daemon.judging.statistics import cut_percentage
from daemon.model.assessments import (
    MISSING_STATES,
    Assessment,
    CellVerdict,
    ExpectationStatus,
    group_errors,
    state_of,
)
from daemon.model.spec import own_version
from daemon.model.status import RunRow
from daemon.model.submission import CampaignOrigin
from daemon.model.verdicts import UNFINISHED_STATES, Outcome, Verdict
from grammars.text.words import NOTHING, count_noun, duration_text, format_quantity
from templates.report import render_report

_FEW: Final = 5
"""Repeats of a finding that are visible at once: the gravest."""
_MOST_LISTED: Final = 50
"""Most repeats listed for each verdict: 250 bytes each, for every oracle of every run."""
_SHOWN_OF_HASH: Final = 12
_MOST_KINDS: Final = 4
"""Most machines, or sets of versions, that are named; more are counted."""
GLYPHS: Final = {
    "pass": "✓", "fail": "✗", "inconclusive": "?", "error": "‼", "measure": "·",
    "lost": "∅", "cancelled": "-", "queued": "…", "running": "▶", "done": "?",
}  # fmt: skip


_Headline: TypeAlias = tuple[Literal["good", "bad", "open"], str, str]
"""Answer to "is it fine?": a tone for its colour, a short word, the sentence."""


RunCommands: TypeAlias = Callable[[str, str, bool], Sequence[tuple[str, str]]]
"""Returns commands about a run, each with its purpose, by the run's id or trace, the name of its
notable oracle, and whether it failed."""


def write_page(
    data: ReportData,
    commands: RunCommands,
    *,
    processes: int | None = None,
    figure_folder: Path | None = None,
) -> str:
    """Return the report as HTML, with suggested ``commands`` about runs.

    Each figure is also written as PDF to ``figure_folder``, if given.
    """
    figures = draw_figures(data, processes=processes)
    if figure_folder is not None:
        write_figures(figures, figure_folder)
    assessment, results = data.assessment, data.input
    scenarios = tuple(dict.fromkeys(cell.scenario for cell in assessment.cells))
    suts = tuple(dict.fromkeys(cell.sut for cell in assessment.cells))
    filters: dict[str, Callable[..., Any]] = {
        "quantity": format_quantity,
        "share": percentage,
        "cut": cut_percentage,
        "glyph": lambda word: GLYPHS.get(str(word), "?"),
        "details": verdict_details,
        # Verdict texts separate columns of a terminal by two blanks.
        "joined": lambda text: text.replace("  ", ", "),
        "place": lambda file: _place(file, results),
        "spread": spread_text,
        "counts": _counts,
        "judged": _judged,
        "commands": lambda run, oracle: _typed(run, oracle, commands, results),
    }
    return render_report(
        filters,
        template="report.html.j2",
        library=page_script(),
        results=results,
        expectations=results.expectations,
        assessment=assessment,
        answer=headline(assessment, data.runs),
        facts=[
            (name, value)
            for name, value in (*_facts(data, scenarios, suts), *_origins(data))
            if value
        ],
        building=draw_building(data),
        scenarios=scenarios,
        suts=suts,
        not_repeatable=results.not_repeatable,
        cells={(cell.scenario, cell.sut): cell for cell in assessment.cells},
        repeats=_repeats(data),
        findings=group_errors(notable_verdicts(data)),
        measures=measure_columns(data),
        largest_errors=tuple(largest_errors(data)),
        figures={kind: [f for f in figures if f.kind == kind] for kind in FIGURE_KINDS},
        moments={(f.scenario, f.sut, f.subject): f for f in figures if f.kind == "moment"},
        references=data.references,
        reference_names=dict.fromkeys((r.name, r.source) for r in results.declared.references),
        runs=data.runs,
        buffer=data.buffer,
        few=_FEW,
        most_listed=_MOST_LISTED,
        most=MOST_CELLS if len(assessment.cells) > MOST_CELLS else 0,
        nothing=NOTHING,
        of_folder=_is_folder(results),
        honest=_strongest_claim(assessment),
        coverage=data.coverage if data.coverage.runs else None,
    )


def headline(assessment: Assessment, runs: Sequence[ReportRun]) -> _Headline:
    """Return one line with the overall answer."""
    oracles = [oracle for cell in assessment.cells for oracle in cell.oracles]
    total = len(oracles) + len(assessment.comparisons)
    verdicts = count_noun(total, "verdict")
    if assessment.exit_code == 0:
        failing = sum(oracle.expected != "pass" and oracle.failed > 0 for oracle in oracles)
        extra = f", {failing} of them known to fail" if failing else ""
        return "good", "Yes", f"All {verdicts} are as expected{extra}."
    judged_by = (*oracles, *assessment.comparisons)
    undecided = sum(one.status is ExpectationStatus.OPEN for one in judged_by)
    if assessment.exit_code == 1:
        count = len(assessment.surprises)
        also = f", {undecided} undecided" if undecided else ""
        verb = "is" if count == 1 else "are"
        return "bad", "No", f"{count} of {verdicts} {verb} not as expected{also}."
    # Neither as expected nor unexpected: report the most basic thing that is missing.
    state = state_of(run.record.state for run in runs)
    if state in UNFINISHED_STATES or state == "cancelled":
        counts = Counter(run.record.state for run in runs)
        missing = ", ".join(f"{counts[one]} {one}" for one in MISSING_STATES if counts[one])
        word = "Not yet" if state in UNFINISHED_STATES else "Not known"
        return "open", word, f"{missing} of {count_noun(len(runs), 'run')}."
    judged = sum(run.record.outcome not in (None, Outcome.ERROR) for run in runs)
    broken = len(runs) - judged
    if broken:
        text = f"{broken} of {count_noun(len(runs), 'run')} could not be executed or judged."
        return "open", "Not known", text
    if not total:
        return "open", "Not known", "No oracle judges these runs."
    return "open", "Not known", f"{undecided} of {verdicts} undecided by these runs."


def _strongest_claim(assessment: Assessment) -> str:
    """Return the strongest claim that the repeats of a cell support, in words."""
    clean = [o for c in assessment.cells for o in c.oracles if o.n and o.passed == o.n]
    return clean[0].statement if clean else ""


def _facts(
    data: ReportData, scenarios: Sequence[str], suts: Sequence[str]
) -> Iterator[tuple[str, str]]:
    """Yield facts about a report's runs, as names and values; unknown ones are empty."""
    records = [run.record for run in data.runs]
    simulated = sum(record.result.timing.simulated for record in records if record.result)
    # The fixed order makes two reports comparable.
    counts = dict.fromkeys(("pass", "fail", "inconclusive", "error", "without a result"), 0)
    for record in records:
        counts[str(record.outcome or "without a result")] += 1
    verdicts = ", ".join(f"{count} {word}" for word, count in counts.items() if count)
    yield "runs", f"{len(records)}: {verdicts}"
    yield "cells", f"{count_noun(len(scenarios), 'scenario')} × {count_noun(len(suts), 'SUT')}"
    yield "not repeatable", ", ".join(data.input.not_repeatable)
    yield "simulated", duration_text(simulated)
    yield "from", _folder(data.input) if _is_folder(data.input) else data.input.row.id


def _origins(data: ReportData) -> Iterator[tuple[str, str]]:
    """Yield the origins of a report's runs, as :func:`_facts` does."""
    origin = data.input.origin
    yield "executed", _span(data.input.row.submitted_at, data.input.row.finished_at)
    if origin.file:
        yield "campaign file", f"{origin.file}, SHA-256 {origin.digest[:_SHOWN_OF_HASH]}…"
        yield "version control", _commit(origin)
    yield "seed", "" if origin.seed is None else str(origin.seed)
    results = [run.record.result for run in data.runs if run.record.result is not None]
    machines = Counter(result.machine for result in results if result.machine)
    yield "machine", _kinds(machines, len(results))
    reused = sum(bool(run.record.cached) for run in data.runs)
    yield "used again", f"{count_noun(reused, 'result')} of earlier campaigns" if reused else ""
    versions = Counter(_versions(run.versions) for run in data.runs if run.versions)
    yield "simulated with", _kinds(versions, len(data.runs))
    yield "page written by", own_version()


def _span(start: float, end: float | None) -> str:
    """Return a date and its times: ``2026-11-23, 15:20 to 15:22 UTC``; empty without a start."""
    if not start:
        return ""
    began = datetime.fromtimestamp(start, UTC)
    if end is None:
        return f"{began:%Y-%m-%d, %H:%M} UTC"
    ended = datetime.fromtimestamp(end, UTC)
    day = "" if ended.date() == began.date() else f"{ended:%Y-%m-%d, }"
    return f"{began:%Y-%m-%d, %H:%M} to {day}{ended:%H:%M} UTC"


def _commit(origin: CampaignOrigin) -> str:
    if origin.changed is None:
        return "no git repository"
    commit = f"commit {origin.commit[:_SHOWN_OF_HASH]}" if origin.commit else "no commit yet"
    branch = f" on {origin.branch}" if origin.branch else ""
    changed = "with changes that are not committed" if origin.changed else "nothing uncommitted"
    return f"{commit}{branch}, {changed}"


def _versions(versions: Iterable[tuple[str, str]]) -> str:
    """Return the versions of a trace in one line, our own first."""
    others = dict(versions)
    ours = [f"{n} {others.pop(n)}" for n in ("scenario-tui", "engine") if others.get(n)]
    return ", ".join((*ours, *(f"{name} {version}" for name, version in sorted(others.items()))))


def _kinds(counts: Counter[str], whole: int) -> str:
    """Return the names, with the number of runs for each if there are several."""
    if len(counts) > _MOST_KINDS:
        return f"{len(counts)} different ones"
    alone = len(counts) == 1 and counts.total() == whole
    return "; ".join(
        name if alone else f"{name} ({count_noun(count, 'run')})" for name, count in counts.items()
    )


def _is_folder(results: CampaignResults) -> bool:
    """Return whether these are results of a folder of traces, whose runs have their names."""
    return bool(results.rows) and results.rows[0].id == results.rows[0].trace


def _folder(results: CampaignResults) -> str:
    name = Path(results.where).name
    return f"the folder {name}" if name else "a folder of traces"


def _place(file: str, results: CampaignResults) -> str:
    """Return the path of a file within the folder of a report; for other files the name alone.

    Receivers of a page need not know the folders of this machine.
    """
    path, folder = Path(file), Path(results.where)
    return path.relative_to(folder).as_posix() if path.is_relative_to(folder) else path.name


def _repeats(data: ReportData) -> dict[tuple[str, str], list[tuple[int, RunRow]]]:
    """Return the runs of each cell, (scenario, SUT), with their places among all runs."""
    cells: dict[tuple[str, str], list[tuple[int, RunRow]]] = {}
    for number, run in enumerate(data.runs, start=1):
        cells.setdefault((run.record.scenario, run.record.sut), []).append((number, run.record))
    return cells


def _judged(
    repeats: Sequence[tuple[int, RunRow]], oracle: str
) -> list[tuple[int, RunRow, Verdict | None]]:
    """Return an oracle's verdict on each repeat, the gravest first; runs without a verdict last."""
    verdicts = [(number, run, run.verdict(oracle)) for number, run in repeats]
    last = (math.inf, False, 0.0)
    return sorted(verdicts, key=lambda one: last if one[2] is None else severity(one[2]))


def _typed(
    run: RunRow, oracle: str, commands: RunCommands, results: CampaignResults
) -> Sequence[tuple[str, str]]:
    """Return commands about a run that ``oracle`` judged, each with its purpose."""
    if not run.trace:
        return ()
    name = _place(run.trace, results) if _is_folder(results) else run.id
    return commands(name, oracle, run.outcome is Outcome.FAIL)


def _counts(oracle: CellVerdict) -> str:
    """Return the number of repeats that do not pass: ``fails in 3 of 5 repeats``."""
    kinds = (
        ("fails", oracle.failed),
        ("is undecided", oracle.inconclusive),
        ("is broken", oracle.errors),
        ("has no result", oracle.missing),
    )
    counts = [(words, count) for words, count in kinds if count] or [("passes", oracle.passed)]
    whole = count_noun(oracle.n, "repeat")
    return ", ".join(f"{words} in {count} of {whole}" for words, count in counts)


def percentage(value: float | None) -> str:
    """Return a rate as per cent with one decimal: ``54.9 %``."""
    return NOTHING if value is None else f"{100.0 * value:.1f} %".replace(".0 %", " %")


def spread_text(values: Sequence[float]) -> str:
    """Return mean and standard deviation with fitting digits: ``0.124 ± 0.003``.

    A single value, or an infinite mean, stands alone; ``–`` means no values.
    """
    mean = fmean(values) if values else None
    if mean is None or len(values) < 2 or not math.isfinite(mean):
        return format_quantity(mean)
    deviation = stdev(values)
    # The first two digits of the deviation limit the meaningful digits of the mean.
    digits = min(_digits(deviation, 1), _digits(mean, 3)) if deviation else _digits(mean, 2)
    return f"{mean:.{digits}f} ± {deviation:.{digits}f}".replace("-", "−")


def _digits(value: float, more: int) -> int:
    """Return the number of decimals that show ``more`` digits after the first significant one."""
    return 2 if value == 0.0 else max(0, min(4, more - math.floor(math.log10(abs(value)))))


def verdict_details(verdict: Verdict) -> str:
    """Return a verdict's margin and evidence: ``−0.012 m, 41.3 s, door_17``.

    Margins without a unit only mean true or false and are left out.
    """
    evidence = verdict.evidence
    parts = [format_quantity(verdict.margin, verdict.unit, signed=True)]
    if verdict.unit == "" or verdict.margin is None:
        parts = []
    parts.append("" if evidence.time is None else f"at {evidence.time:.1f} s")
    # Output of a stack follows below the first line, and in the list of runs.
    parts.extend((evidence.object, evidence.note_text.partition("\n")[0]))
    return ", ".join(part for part in parts if part)
