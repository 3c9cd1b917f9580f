"""The report as a page: what it says, in what order, in which words."""

from __future__ import annotations

import shlex
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Final, Literal

from markupsafe import Markup

from daemon.assessment import Assessment, Cell, OracleCell
from daemon.coverage import bars
from daemon.report._figures import (
    MOST_CELLS,
    Figure,
    draw_figures,
    findings,
    scenarios_with_triggers,
)
from daemon.report._gather import Gathered, Material
from daemon.report._series import MEASURES, Measure
from daemon.report._svg import SERIES
from daemon.report._words import (
    GLYPHS,
    NOTHING,
    counted,
    quantity,
    said,
    share,
    span,
    spread_of,
)
from daemon.verdict import Outcome
from templates.report import render_report

_FIGURE_KINDS: Final = ("localisation", "way", "distance", "inside", "trigger")


@dataclass(frozen=True, slots=True)
class Answer:
    """Whether it is fine: one word for its colour, a short word, the sentence."""

    tone: Literal["good", "bad", "open"]
    word: str
    sentence: str


@dataclass(frozen=True, slots=True)
class Finding:
    """An oracle of a cell worth a closer look: its repeats, what to type, the deciding moment."""

    oracle: OracleCell
    text: str
    runs: tuple[tuple[str, str, str], ...]
    commands: tuple[tuple[str, str], ...]
    moment: tuple[str, Markup] | None


@dataclass(frozen=True, slots=True)
class MeasureRow:
    """One measure of one cell: mean, deviation, and the range as words."""

    mean: str
    deviation: str
    range: str


@dataclass(frozen=True, slots=True)
class Command:
    """Something to type about a run: ``{run}`` is replaced by the run's id or trace.

    With ``failing`` only about runs that failed.
    """

    text: str
    purpose: str
    failing: bool = False


def write_page(
    material: Material, commands: Sequence[Command], *, processes: int | None = None
) -> str:
    """Return the report as HTML; ``commands`` are what people can type about a run.

    Raises :class:`InputError` without the extra ``report``.
    """
    figures = draw_figures(material, processes=processes)
    assessment = material.assessment
    scenarios = tuple(dict.fromkeys(cell.scenario for cell in assessment.cells))
    suts = tuple(dict.fromkeys(cell.sut for cell in assessment.cells))
    used = tuple(m for m in MEASURES if any(m.name in r.driven.measures for r in material.runs))
    filters = {
        "quantity": quantity,
        "share": share,
        "glyph": lambda word: GLYPHS.get(str(word), "?"),
        "said": said,
        "bars": bars,
        "joined": lambda text: text.replace("  ", ", ").replace(" -", " −"),
    }
    return render_report(
        filters,
        chosen=material.chosen,
        assessment=assessment,
        answer=answer(assessment, material.runs),
        facts=_facts(material, scenarios, suts),
        scenarios=scenarios,
        suts=suts,
        cells={(cell.scenario, cell.sut): cell for cell in assessment.cells},
        surprised={(s.scenario, s.sut) for s in assessment.surprises},
        findings=_findings(material, commands, figures),
        compared=[(group, _compared(material, group)) for group in _grouped(used)],
        declared_measures=_declared(assessment),
        boxes=[_ready(f) for f in figures if f.kind.startswith("boxes")],
        worst=[_ready(f) for f in figures if f.kind == "worst-localisation"],
        worst_run=next((f.sut for f in figures if f.kind == "worst-localisation"), ""),
        by_kind={k: _by_scenario([f for f in figures if f.kind == k]) for k in _FIGURE_KINDS},
        sut_colours=_colours(suts),
        trigger_colours=_colours(scenarios_with_triggers(material)),
        runs=material.runs,
        buffer=material.buffer,
        most=MOST_CELLS if len(assessment.cells) > MOST_CELLS else 0,
        nothing=NOTHING,
        honest=_honest(assessment),
        coverage=material.coverage if material.coverage.runs else None,
    )


def answer(assessment: Assessment, runs: Sequence[Gathered]) -> Answer:
    """Return the one line that says whether it is fine."""
    oracles = [oracle for cell in assessment.cells for oracle in cell.oracles]
    total = len(oracles) + len(assessment.comparisons)
    verdicts = counted(total, "verdict")
    if assessment.exit_code == 0:
        known = sum(oracle.expected != "pass" for oracle in oracles)
        extra = f", {known} of them known to fail" if known else ""
        return Answer("good", "Yes", f"All {verdicts} are as expected{extra}.")
    missed = [oracle for oracle in oracles if not oracle.met]
    undecided = len(missed) + sum(not cell.met for cell in assessment.comparisons)
    undecided -= len(assessment.surprises)
    if assessment.exit_code == 1:
        count = len(assessment.surprises)
        also = f", {undecided} undecided" if undecided > 0 else ""
        verb = "is" if count == 1 else "are"
        return Answer("bad", "No", f"{count} of {verdicts} {verb} not as expected{also}.")
    judged = sum(run.record.outcome not in (None, Outcome.ERROR) for run in runs)
    broken = len(runs) - judged
    if broken:
        text = f"{broken} of {counted(len(runs), 'run')} could not be executed or judged."
        return Answer("open", "Not known", text)
    if not total:
        return Answer("open", "Not known", "No oracle judges these runs.")
    return Answer("open", "Not known", f"{undecided} of {verdicts} undecided by these runs.")


def _honest(assessment: Assessment) -> str:
    """Return what the repeats of a cell can show at best, in words."""
    clean = [o for c in assessment.cells for o in c.oracles if o.n and o.passed == o.n]
    return clean[0].statement if clean else ""


def _facts(
    material: Material, scenarios: Sequence[str], suts: Sequence[str]
) -> tuple[tuple[str, str], ...]:
    records = [run.record for run in material.runs]
    simulated = sum(record.timing.simulated for record in records if record.timing)
    counts = dict.fromkeys(("pass", "fail", "inconclusive", "error", "without a result"), 0)
    for record in records:
        counts[str(record.outcome or "without a result")] += 1
    verdicts = ", ".join(f"{count} {word}" for word, count in counts.items() if count)
    return (
        ("runs", f"{len(records)}: {verdicts}"),
        ("cells", f"{counted(len(scenarios), 'scenario')} × {counted(len(suts), 'SUT')}"),
        ("simulated", span(simulated)),
        ("from", material.chosen.id or material.chosen.where),
    )


def _findings(
    material: Material, commands: Sequence[Command], figures: Sequence[Figure]
) -> tuple[Finding, ...]:
    shown = {(f.scenario, f.sut, f.kind): f for f in figures if f.svg}
    return tuple(
        _finding(o, material, commands, shown.get((o.scenario, o.sut, f"moment {o.oracle}")))
        for o in findings(material)
    )


def _finding(
    oracle: OracleCell, material: Material, commands: Sequence[Command], moment: Figure | None
) -> Finding:
    here = [
        run.record
        for run in material.runs
        if (run.record.scenario, run.record.sut) == (oracle.scenario, oracle.sut)
    ]
    judged = [(r, v) for r in here if (v := r.verdict(oracle.oracle)) is not None]
    runs = tuple((f"repeat {r.repeat}", str(v.outcome), said(v)) for r, v in judged)
    text = judged[0][1].text if judged else ""
    shown = next((r for r in here if oracle.worst and r.id == oracle.worst.run), None)
    picture = None if moment is None else _ready(moment)
    if shown is None:
        return Finding(oracle, text, runs, (), picture)
    name = shown.id if material.chosen.id else shown.trace or shown.id
    failed = shown.outcome is Outcome.FAIL
    typed = tuple(
        (c.text.format(run=shlex.quote(name)), c.purpose)
        for c in commands
        if failed or not c.failing
    )
    return Finding(oracle, text, runs, typed, picture)


def _grouped(measures: Sequence[Measure]) -> list[tuple[Measure, ...]]:
    """Return the measures in tables that fit on paper: those of localisation by themselves."""
    groups = ([m for m in measures if m.localisation is wanted] for wanted in (False, True))
    return [tuple(group) for group in groups if group]


def _compared(
    material: Material, measures: Sequence[Measure]
) -> tuple[tuple[Cell, tuple[MeasureRow | None, ...]], ...]:
    """Return the measures of every cell, in the order of ``measures``."""
    found = []
    for cell in material.assessment.cells:
        of = set(cell.runs)
        runs = [run.driven.measures for run in material.runs if run.record.id in of]
        rows = []
        for measure in measures:
            values = [run[measure.name] for run in runs if measure.name in run]
            rows.append(_row(values, measure.unit) if values else None)
        found.append((cell, tuple(rows)))
    return tuple(found)


def _row(values: Sequence[float], unit: str) -> MeasureRow:
    mean, deviation = spread_of(values)
    extent = f"{quantity(min(values), unit)} to {quantity(max(values), unit)}, n={len(values)}"
    return MeasureRow(mean, deviation, extent)


def _declared(
    assessment: Assessment,
) -> tuple[tuple[str, str, tuple[tuple[Cell, MeasureRow], ...]], ...]:
    """Return the measures the campaign names itself: name, unit, and the cells that have it."""
    found: dict[tuple[str, str], list[tuple[Cell, MeasureRow]]] = {}
    for cell in assessment.cells:
        for measure in cell.measures:
            row = _row(measure.values, measure.unit)
            found.setdefault((measure.oracle, measure.unit), []).append((cell, row))
    return tuple((name, unit, tuple(rows)) for (name, unit), rows in found.items())


def _colours(names: Sequence[str]) -> list[tuple[str, str]]:
    """Return names with the variable of the page that holds their colour in figures."""
    return [(name, f"--s{number % len(SERIES)}") for number, name in enumerate(names)]


def _ready(figure: Figure) -> tuple[str, Markup]:
    # Figures are drawn here, from numbers and escaped names, never taken from a file.
    return figure.caption, Markup(figure.svg)


def _by_scenario(figures: Sequence[Figure]) -> dict[str, list[tuple[str, Markup]]]:
    found: dict[str, list[tuple[str, Markup]]] = {}
    for figure in figures:
        found.setdefault(figure.scenario, []).append(_ready(figure))
    return found
