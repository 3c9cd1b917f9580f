"""The report as a page: what it says, in what order, in which words."""

from __future__ import annotations

import shlex
from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass
from itertools import chain
from pathlib import Path
from typing import Final, Literal

from markupsafe import Markup

from daemon.analysis.report._building import draw_building
from daemon.analysis.report._data import ReportData, ReportRun
from daemon.analysis.report._figures import (
    MOST_CELLS,
    MOST_MOMENTS,
    ReportFigure,
    draw_figures,
    notable_verdicts,
    scenarios_with_triggers,
)
from daemon.analysis.report._formatting import (
    GLYPHS,
    NOTHING,
    duration_text,
    format_quantity,
    mean_and_deviation,
    percentage,
    verdict_details,
)
from daemon.analysis.report._input import ReportInput
from daemon.analysis.report._provenance import provenance
from daemon.analysis.report._references import compared_references, reference_names
from daemon.analysis.report._svg import SERIES
from daemon.analysis.report._tracks import MEASURES, RunMeasure
from daemon.judging.statistics import cut_percentage
from daemon.model.assessments import (
    MISSING_STATES,
    Assessment,
    CellAssessment,
    CellVerdict,
    ExpectationStatus,
    ReferenceComparison,
    group_errors,
    state_of,
)
from daemon.model.run_state import UNFINISHED_STATES
from daemon.model.verdicts import Outcome
from grammars.text.words import count_noun
from templates.report import render_report

_FIGURE_KINDS: Final = (
    "localisation", "way", "distance", "inside", "returns", "run-pair", "trigger",
)  # fmt: skip


@dataclass(frozen=True, slots=True)
class Headline:
    """Whether it is fine: one word for its colour, a short word, the sentence."""

    tone: Literal["good", "bad", "open"]
    word: str
    sentence: str


@dataclass(frozen=True, slots=True)
class ReportFinding:
    """An oracle of a cell worth a closer look: its repeats, what to type, the deciding moment.

    ``names`` are those of all oracles that an error left without a verdict, this one among them.
    """

    oracle: CellVerdict
    names: str
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
class ReferenceRow:
    """A reference value beside what was found, in words; ``interval`` is the 95 % one."""

    scenario: str
    sut: str
    quantity: str
    reference: str
    runs: str
    here: str
    interval: str
    n: int
    difference: str
    source: str


@dataclass(frozen=True, slots=True)
class SuggestedCommand:
    """Something to type about a run: ``{run}`` is replaced by the run's id or trace, ``{oracle}``
    by the name of the oracle that makes it worth a look.

    With ``failing`` only about runs that failed.
    """

    text: str
    purpose: str
    failing: bool = False


def write_page(
    data: ReportData, commands: Sequence[SuggestedCommand], *, processes: int | None = None
) -> str:
    """Return the report as HTML; ``commands`` are what people can type about a run."""
    figures = draw_figures(data, processes=processes)
    assessment = data.assessment
    scenarios = tuple(dict.fromkeys(cell.scenario for cell in assessment.cells))
    suts = tuple(dict.fromkeys(cell.sut for cell in assessment.cells))
    used = tuple(m for m in MEASURES if any(m.name in r.tracks.measures for r in data.runs))
    filters = {
        "quantity": format_quantity,
        "share": percentage,
        "cut": cut_percentage,
        "glyph": lambda word: GLYPHS.get(str(word), "?"),
        "said": verdict_details,
        # Verdict texts align columns of a terminal by two blanks.
        "joined": lambda text: text.replace("  ", ", ").replace(" -", " −"),
        "place": lambda file: _place(file, data.input),
    }
    return render_report(
        filters,
        chosen=data.input,
        assessment=assessment,
        answer=headline(assessment, data.runs),
        facts=_facts(data, scenarios, suts),
        provenance=provenance(data),
        building=draw_building(data),
        scenarios=scenarios,
        suts=suts,
        not_repeatable=_not_repeatable(data),
        cells={(cell.scenario, cell.sut): cell for cell in assessment.cells},
        findings=_findings(data, commands, figures),
        compared=[(group, _compared(data, group)) for group in _grouped(used)],
        declared_measures=_declared(assessment),
        boxes=[_as_markup(f) for f in figures if f.kind == "boxes"],
        comparison_figures=[_as_markup(f) for f in figures if f.kind == "comparison"],
        references=reference_rows(data),
        reference_names=reference_names(data.input.declared.references),
        worst=_by_run([f for f in figures if f.kind == "worst-localisation"]),
        by_kind={k: _by_scenario([f for f in figures if f.kind == k]) for k in _FIGURE_KINDS},
        sut_colours=_colours(suts),
        trigger_colours=_colours(scenarios_with_triggers(data)),
        runs=data.runs,
        buffer=data.buffer,
        most=MOST_CELLS if len(assessment.cells) > MOST_CELLS else 0,
        nothing=NOTHING,
        honest=_strongest_claim(assessment),
        unseen=_unseen(data),
        coverage=data.coverage if data.coverage.runs else None,
    )


def headline(assessment: Assessment, runs: Sequence[ReportRun]) -> Headline:
    """Return the one line that says whether it is fine."""
    oracles = [oracle for cell in assessment.cells for oracle in cell.oracles]
    total = len(oracles) + len(assessment.comparisons)
    verdicts = count_noun(total, "verdict")
    if assessment.exit_code == 0:
        known = sum(oracle.expected != "pass" for oracle in oracles)
        extra = f", {known} of them known to fail" if known else ""
        return Headline("good", "Yes", f"All {verdicts} are as expected{extra}.")
    judged_by = (*oracles, *assessment.comparisons)
    undecided = sum(one.status is ExpectationStatus.OPEN for one in judged_by)
    if assessment.exit_code == 1:
        count = len(assessment.surprises)
        also = f", {undecided} undecided" if undecided else ""
        verb = "is" if count == 1 else "are"
        return Headline("bad", "No", f"{count} of {verdicts} {verb} not as expected{also}.")
    # Neither as expected nor unexpected: say what is missing, the most basic first.
    state = state_of(run.record.state for run in runs)
    if state in UNFINISHED_STATES or state == "cancelled":
        counts = Counter(run.record.state for run in runs)
        missing = ", ".join(f"{counts[one]} {one}" for one in MISSING_STATES if counts[one])
        word = "Not yet" if state in UNFINISHED_STATES else "Not known"
        return Headline("open", word, f"{missing} of {count_noun(len(runs), 'run')}.")
    judged = sum(run.record.outcome not in (None, Outcome.ERROR) for run in runs)
    broken = len(runs) - judged
    if broken:
        text = f"{broken} of {count_noun(len(runs), 'run')} could not be executed or judged."
        return Headline("open", "Not known", text)
    if not total:
        return Headline("open", "Not known", "No oracle judges these runs.")
    return Headline("open", "Not known", f"{undecided} of {verdicts} undecided by these runs.")


def _strongest_claim(assessment: Assessment) -> str:
    """Return what the repeats of a cell can show at best, in words."""
    clean = [o for c in assessment.cells for o in c.oracles if o.n and o.passed == o.n]
    return clean[0].statement if clean else ""


def _unseen(data: ReportData) -> tuple[str, ...]:
    """Return the findings beyond those whose moment is drawn."""
    return tuple(
        f"{o.scenario} with {o.sut}: {o.oracle}" for o in notable_verdicts(data)[MOST_MOMENTS:]
    )


def _facts(
    data: ReportData, scenarios: Sequence[str], suts: Sequence[str]
) -> tuple[tuple[str, str], ...]:
    records = [run.record for run in data.runs]
    simulated = sum(record.result.timing.simulated for record in records if record.result)
    # In this order whatever comes first, so that two reports can be laid side by side.
    counts = dict.fromkeys(("pass", "fail", "inconclusive", "error", "without a result"), 0)
    for record in records:
        counts[str(record.outcome or "without a result")] += 1
    verdicts = ", ".join(f"{count} {word}" for word, count in counts.items() if count)
    external = _not_repeatable(data)
    marked = (("not repeatable", ", ".join(external)),) if external else ()
    return (
        ("runs", f"{len(records)}: {verdicts}"),
        ("cells", f"{count_noun(len(scenarios), 'scenario')} × {count_noun(len(suts), 'SUT')}"),
        *marked,
        ("simulated", duration_text(simulated)),
        ("from", data.input.id or _folder(data.input)),
    )


def _folder(chosen: ReportInput) -> str:
    name = Path(chosen.where).name
    return f"the folder {name}" if name else "a folder of traces"


def _place(file: str, chosen: ReportInput) -> str:
    """Return a file as seen from the folder a report is of, elsewhere its name alone.

    A page is sent to people whom the folders of this machine do not concern.
    """
    path, folder = Path(file), Path(chosen.where)
    return path.relative_to(folder).as_posix() if path.is_relative_to(folder) else path.name


def _not_repeatable(data: ReportData) -> tuple[str, ...]:
    """Return the systems of which the same run gives something else each time."""
    return tuple(dict.fromkeys(r.record.sut for r in data.runs if not r.record.repeatable))


def _findings(
    data: ReportData, commands: Sequence[SuggestedCommand], figures: Sequence[ReportFigure]
) -> tuple[ReportFinding, ...]:
    moments = {(f.scenario, f.sut, f.subject): f for f in figures if f.kind == "moment" and f.svg}
    return tuple(
        _finding(group, data, commands, moments.get((o.scenario, o.sut, o.oracle)))
        for group in group_errors(notable_verdicts(data))
        for o in group[:1]
    )


def _finding(
    oracles: Sequence[CellVerdict],
    data: ReportData,
    commands: Sequence[SuggestedCommand],
    moment: ReportFigure | None,
) -> ReportFinding:
    oracle, names = oracles[0], ", ".join(one.oracle for one in oracles)
    here = [
        run.record
        for run in data.runs
        if (run.record.scenario, run.record.sut) == (oracle.scenario, oracle.sut)
    ]
    judged = [(r, v) for r in here if (v := r.verdict(oracle.oracle)) is not None]
    runs = tuple((f"repeat {r.repeat}", str(v.outcome), verdict_details(v)) for r, v in judged)
    text = judged[0][1].text if judged else ""
    shown = next((r for r in here if oracle.worst and r.id == oracle.worst.run), None)
    picture = None if moment is None else _as_markup(moment)
    if shown is None:
        return ReportFinding(oracle, names, text, runs, (), picture)
    # A folder of traces has no ids that commands would know, but the names of its files.
    name = shown.trace and _place(shown.trace, data.input)
    name = shown.id if data.input.id else name or shown.id
    failed = shown.outcome is Outcome.FAIL
    typed = tuple(
        (c.text.format(run=shlex.quote(name), oracle=shlex.quote(oracle.oracle)), c.purpose)
        for c in commands
        if failed or not c.failing
    )
    return ReportFinding(oracle, names, text, runs, typed, picture)


def _grouped(measures: Sequence[RunMeasure]) -> list[tuple[RunMeasure, ...]]:
    """Return the measures in tables that fit on paper: those of localisation by themselves."""
    groups = ([m for m in measures if m.localisation is wanted] for wanted in (False, True))
    return [tuple(group) for group in groups if group]


def _compared(
    data: ReportData, measures: Sequence[RunMeasure]
) -> tuple[tuple[CellAssessment, tuple[MeasureRow | None, ...]], ...]:
    """Return the measures of every cell, in the order of ``measures``; a scenario's together."""
    # Traces may lie in a folder for each system: then those of a scenario are not side by side.
    together: dict[str, list[CellAssessment]] = {}
    for cell in data.assessment.cells:
        together.setdefault(cell.scenario, []).append(cell)
    found = []
    for cell in chain.from_iterable(together.values()):
        of = set(cell.runs)
        runs = [run.tracks.measures for run in data.runs if run.record.id in of]
        rows = []
        for measure in measures:
            values = [run[measure.name] for run in runs if measure.name in run]
            rows.append(_row(values, measure.unit) if values else None)
        found.append((cell, tuple(rows)))
    return tuple(found)


def _row(values: Sequence[float], unit: str) -> MeasureRow:
    mean, deviation = mean_and_deviation(values)
    least, most = format_quantity(min(values), unit), format_quantity(max(values), unit)
    return MeasureRow(mean, deviation, f"{least} to {most}, n={len(values)}")


def _declared(
    assessment: Assessment,
) -> tuple[tuple[str, str, tuple[tuple[CellAssessment, MeasureRow], ...]], ...]:
    """Return the measures the campaign names itself: name, unit, and the cells that have it."""
    found: dict[tuple[str, str], list[tuple[CellAssessment, MeasureRow]]] = {}
    for cell in assessment.cells:
        for measure in cell.measures:
            row = _row(measure.values, measure.unit)
            found.setdefault((measure.oracle, measure.unit), []).append((cell, row))
    return tuple((name, unit, tuple(rows)) for (name, unit), rows in found.items())


def reference_rows(data: ReportData) -> tuple[ReferenceRow, ...]:
    """Return the reference values of the campaign, each beside what was found here."""
    return tuple(map(_reference_row, compared_references(data.input, data.assessment)))


def _lower_bound(rate: float | None) -> str:
    return percentage(None) if rate is None else cut_percentage(rate)


def _reference_row(compared: ReferenceComparison) -> ReferenceRow:
    reference, unit = compared.reference, compared.reference.unit
    if reference.statistic == "rate":
        passed = round((compared.value or 0.0) * compared.n)
        here, difference = f"{passed} of {compared.n}", ""
        bounds: tuple[str, ...] = (_lower_bound(compared.low), percentage(compared.high))
    else:
        here = format_quantity(compared.value, unit, digits=4)
        if compared.deviation is not None and reference.statistic == "mean":
            here += f" ± {format_quantity(compared.deviation, unit)}"
        difference = format_quantity(compared.difference, unit, signed=True)
        bounds = tuple(format_quantity(b, unit, digits=4) for b in (compared.low, compared.high))
    known = compared.low is not None and compared.high is not None
    return ReferenceRow(
        scenario=compared.scenario,
        sut=compared.sut,
        quantity=reference.oracle
        + ("" if reference.statistic in ("mean", "rate") else f", {reference.statistic}"),
        reference=f"{reference.name} {reference.text}",
        runs="" if reference.runs is None else str(reference.runs),
        here=here,
        interval=" to ".join(bounds) if known else "",
        n=compared.n,
        difference=difference,
        source=", ".join(part for part in (reference.source, reference.note) if part),
    )


def _by_run(figures: Sequence[ReportFigure]) -> dict[str, list[tuple[str, Markup]]]:
    found: dict[str, list[tuple[str, Markup]]] = {}
    for figure in figures:
        found.setdefault(figure.sut, []).append(_as_markup(figure))
    return found


def _colours(names: Sequence[str]) -> list[tuple[str, str]]:
    """Return names with the variable of the page that holds their colour in figures."""
    return [(name, f"--s{number % len(SERIES)}") for number, name in enumerate(names)]


def _as_markup(figure: ReportFigure) -> tuple[str, Markup]:
    # Figures are drawn here, from numbers and escaped names, never taken from a file.
    return figure.caption, Markup(figure.svg)


def _by_scenario(figures: Sequence[ReportFigure]) -> dict[str, list[tuple[str, Markup]]]:
    found: dict[str, list[tuple[str, Markup]]] = {}
    for figure in figures:
        found.setdefault(figure.scenario, []).append(_as_markup(figure))
    return found
