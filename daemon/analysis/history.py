"""The history of a campaign: its submissions side by side, the changes between them, and its page.

Everything comes from the ledger: results, specifications, declarations. No trace is read.
"""

from __future__ import annotations

import json
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from datetime import UTC, datetime
from operator import attrgetter
from statistics import median
from typing import Final, TypeAlias

from daemon.analysis import charts
from daemon.analysis.charts import SERIES, Chart
from daemon.analysis.results import CampaignResults, read_results
from daemon.batch.errors import Refused
from daemon.judging.assessment import (
    QuantityChange,
    VerdictChange,
    compare_campaigns,
)
from daemon.model.assessments import CellAssessment
from daemon.model.spec import RunSpec, own_version
from daemon.model.status import RunRow
from daemon.model.verbs import CampaignSource
from daemon.model.verdicts import Outcome
from grammars.text import codec
from grammars.text.words import NOTHING, count_noun, enumerate_words, format_quantity
from templates.report import render_report

_LONGEST: Final = 60
"""Most characters of a value that is shown before and after; a longer one only "changed"."""
_MOST_NAMED: Final = 2
_SHOWN_OF_HASH: Final = 12
_WIDTH: Final = 620
"""Width of a panel [px]."""


Setup: TypeAlias = Mapping[str, Mapping[str, str]]
"""Inputs of a submission: aspects and their values, by subject (``system pilot``)."""


@dataclass(frozen=True, slots=True)
class OracleRecord:
    """An oracle of a scenario with a system in one submission.

    ``passed`` of ``n`` repeats pass, ``low`` to ``high`` is the exact 95 % interval of the rate.
    ``worst`` and ``median`` are margins [``unit``] of repeats that pass or fail, ``None`` if no
    repeat has one. ``simulated`` and ``cpu`` are medians of the times of a run [s].
    """

    scenario: str
    sut: str
    oracle: str
    unit: str
    verdict: str
    passed: int
    n: int
    low: float
    high: float
    worst: float | None
    median: float | None
    simulated: float | None
    cpu: float | None

    @property
    def cell(self) -> tuple[str, str]:
        """The scenario and the system."""
        return self.scenario, self.sut


@dataclass(frozen=True, slots=True)
class SubmissionRecord:
    """A submission of a campaign, and its differences from the previous one.

    ``cpu`` [s] is the time of its runs, without reused results. ``changes`` are changes of its
    inputs, ``verdicts`` changes of its verdicts. ``quantities`` are margins, measures and durations
    that differ by more than chance.
    """

    id: str
    submitted_at: float
    runs: int
    unfinished: int
    as_expected: bool
    commit: str
    branch: str
    uncommitted: bool | None
    machines: tuple[str, ...]
    cpu: float
    oracles: tuple[OracleRecord, ...]
    changes: tuple[str, ...] = ()
    verdicts: tuple[VerdictChange, ...] = ()
    quantities: tuple[QuantityChange, ...] = ()


@dataclass(frozen=True, slots=True)
class CampaignHistory:
    """The submissions of the campaigns called ``name``, the oldest first."""

    name: str
    submissions: tuple[SubmissionRecord, ...]

    @property
    def headline(self) -> str:
        """One sentence about the newest submission and its changes since the previous one."""
        newest = self.submissions[-1]
        if len(self.submissions) == 1:
            return f"{newest.id} is the only submission of {self.name}: nothing to compare yet"
        count = count_noun(len(newest.oracles), "verdict")
        since = f"changed since {self.submissions[-2].id}"
        if newest.verdicts:
            words = _some_of([verdict_words(change) for change in newest.verdicts])
            return f"{len(newest.verdicts)} of {count} {since}: {words}"
        words = _some_of([quantity_words(change) for change in newest.quantities])
        return f"none of {count} {since}{f', but values did: {words}' if words else ''}"

    @property
    def cells(self) -> tuple[tuple[str, str], ...]:
        """The scenarios with their systems in any submission, the newest ones first."""
        newest_first = reversed(self.submissions)
        return tuple(dict.fromkeys(one.cell for each in newest_first for one in each.oracles))


@dataclass(frozen=True, slots=True)
class WrittenHistory:
    """The history of a campaign, and the files written about it."""

    answer: str
    history: CampaignHistory
    written: dict[str, str]


def verdict_words(change: VerdictChange) -> str:
    """Return ``keeps-clear of S1 (pilot) pass → fail, 5/5 → 2/5``."""
    about = f"{change.oracle} of {change.scenario} ({change.sut})"
    if change.before is None or change.after is None:
        return f"{about} {'is new' if change.before is None else 'is gone'}"
    counts = f"{change.passed_before} → {change.passed_after}"
    return f"{about} {change.before} → {change.after}, {counts}"


def quantity_words(change: QuantityChange) -> str:
    """Return ``keeps-clear of S1 (pilot) 0.12 → 0.05 m``."""
    values = f"{format_quantity(change.before)} → {format_quantity(change.after, change.unit)}"
    return f"{change.quantity} of {change.scenario} ({change.sut}) {values}"


def read_history(source: CampaignSource, name: str) -> CampaignHistory:
    """Return the history of the campaigns of a name, without searches.

    Raises :class:`daemon.batch.errors.DaemonError` if only searches have that name, and if a ledger
    or daemon cannot be read.
    """
    rows = [row for row in source.campaign_page(name=name) if not row.search]
    if not rows:
        raise Refused(f"{name} is a search, which has no history: see `scenario report {name}`")
    submissions: list[SubmissionRecord] = []
    before: tuple[CampaignResults, Setup] | None = None
    for row in sorted(rows, key=lambda row: row.submitted_at):
        results = read_results(source, row)
        # Repeats of a cell differ only in their seeds, so the first stands for all.
        firsts = {(one.scenario, one.sut): one.id for one in reversed(results.rows)}
        setup = _setup(results, [source.run(run).spec for run in reversed(firsts.values())])
        submissions.append(_submission(results, setup, before))
        before = (results, setup)
    return CampaignHistory(name, tuple(submissions))


def _submission(
    results: CampaignResults, setup: Setup, before: tuple[CampaignResults, Setup] | None
) -> SubmissionRecord:
    row, rows, origin, cells = results.row, results.rows, results.origin, results.assessment.cells
    difference = compare_campaigns(before[0].judged, results.judged) if before else None
    shifts = difference.shifts if difference else ()
    own = [one.result for one in rows if one.result is not None and not one.cached]
    return SubmissionRecord(
        id=row.id,
        submitted_at=row.submitted_at,
        runs=len(rows),
        unfinished=sum(not one.settled for one in rows),
        as_expected=results.assessment.exit_code == 0,
        commit=origin.commit,
        branch=origin.branch,
        uncommitted=origin.changed,
        machines=_machines(rows),
        cpu=sum(result.timing.cpu for result in own),
        oracles=tuple(one for cell in cells for one in _oracles(cell, results.runs_of(cell))),
        changes=tuple(_changes(before[1], setup)) if before else (),
        verdicts=difference.verdicts if difference else (),
        quantities=tuple(shift for shift in shifts if shift.changed),
    )


def _oracles(cell: CellAssessment, runs: Sequence[RunRow]) -> Iterator[OracleRecord]:
    times = [one.result.timing for one in runs if one.result is not None]
    for oracle in cell.oracles:
        verdicts = [one.verdict(oracle.oracle) for one in runs if one.ended != "crashed"]
        judged = [one for one in verdicts if one and one.outcome in (Outcome.PASS, Outcome.FAIL)]
        # Margins without a unit only mean true or false.
        margins = [one.margin for one in judged if one.margin is not None and one.unit]
        yield OracleRecord(
            scenario=cell.scenario,
            sut=cell.sut,
            oracle=oracle.oracle,
            unit=next((one.unit for one in judged), ""),
            verdict=oracle.word,
            passed=oracle.passed,
            n=oracle.n,
            low=oracle.low,
            high=oracle.high,
            worst=min(margins, default=None),
            median=_median(margins),
            simulated=_median([time.simulated for time in times]),
            cpu=_median([time.cpu for time in times]),
        )


def _median(values: Sequence[float]) -> float | None:
    return median(values) if values else None


def _machines(records: Iterable[RunRow]) -> tuple[str, ...]:
    names = {record.result.machine for record in records if record.result is not None}
    return tuple(sorted(filter(None, names)))


def _setup(results: CampaignResults, specs: Sequence[RunSpec]) -> Setup:
    origin, declared, policy = results.origin, results.declared, results.declared.policy
    uncommitted = " with uncommitted changes" if origin.changed else ""
    setup: dict[str, dict[str, str]] = {
        "": {
            "campaign file": origin.digest,
            "commit": f"{origin.commit[:_SHOWN_OF_HASH]}{uncommitted}" if origin.commit else "",
            "branch": origin.branch,
            "seed": "" if origin.seed is None else str(origin.seed),
            "engine": ", ".join(sorted({spec.engine for spec in specs})),
            "machine": ", ".join(_machines(results.rows)),
            "repeats": str(policy.n),
            "policy": f"rate {policy.rate:g}" if policy.rule == "rate" else policy.rule,
            "expectations": codec.digest(declared.expectations),
            "comparisons": codec.digest(declared.comparisons),
        }
    }
    for spec in specs:
        sut = spec.sut
        parameters = {key: json.dumps(value) for key, value in sut.parameters.items()}
        setup[f"system {sut.name}"] = {"kind": sut.kind, **parameters, **sut.files}
        setup[f"scenario {spec.scenario}"] = {
            "building": spec.scene,
            "robot": codec.digest(spec.robot),
            "mission": codec.digest(spec.mission),
            "moving objects": codec.digest(spec.behaviours),
            "map": codec.digest(spec.map),
            "limit": f"{spec.limit:g} s",
            **{f"oracle {oracle.name}": oracle.text for oracle in spec.oracles},
        }
    return setup


def _changes(before: Setup, after: Setup) -> Iterator[str]:
    """Yield additions, removals and changes; a change shared by several subjects comes once."""
    subjects: dict[str, list[str]] = {}
    for subject in dict.fromkeys((*before, *after)):
        if subject not in before or subject not in after:
            yield f"{subject} {'came' if subject in after else 'went'}"
            continue
        old, new = before[subject], after[subject]
        for aspect in dict.fromkeys((*old, *new)):
            if words := _change_words(aspect, old.get(aspect, ""), new.get(aspect, "")):
                subjects.setdefault(words, []).append(subject)
    for words, names in subjects.items():
        about = _some_of(names)
        yield f"{about}: {words}" if about else words


def _some_of(words: Sequence[str]) -> str:
    """Return the first of some words, and how many more there are."""
    more = len(words) - _MOST_NAMED
    return enumerate_words([*words[:_MOST_NAMED], f"{more} more"] if more > 0 else words)


def _change_words(aspect: str, old: str, new: str) -> str:
    if old == new:
        return ""
    if not old or not new:
        value = old or new
        in_brackets = f" ({value})" if len(value) < _LONGEST else ""
        return f"{aspect} {'came' if new else 'went'}{in_brackets}"
    if max(len(old), len(new)) > _LONGEST:
        return f"{aspect} changed"
    return f"{aspect} {old} → {new}"


def history_page(history: CampaignHistory) -> str:
    """Return the history of a campaign as self-contained HTML."""
    panels = [_cell_chart(history, cell) for cell in history.cells]
    names = [f"{scenario} with {sut}" for scenario, sut in history.cells]
    figures = [
        (name, charts.chart_figure(chart, svg, f"{name} over time"))
        for name, chart, svg in zip(names, panels, charts.draw_charts(panels), strict=True)
    ]
    return render_report(
        {
            "quantity": format_quantity,
            "moment": lambda at: f"{datetime.fromtimestamp(at, UTC):%Y-%m-%d %H:%M} UTC",
            "commit": _commit_text,
            "verdict": verdict_words,
            "change": quantity_words,
        },
        template="history.html.j2",
        library=charts.page_script(),
        history=history,
        figures=figures,
        version=own_version(),
        nothing=NOTHING,
    )


def _commit_text(submission: SubmissionRecord) -> str:
    if not submission.commit:
        return NOTHING
    branch = f" on {submission.branch}" if submission.branch else ""
    return f"{submission.commit[:8]}{branch}{', uncommitted' if submission.uncommitted else ''}"


def _cell_chart(history: CampaignHistory, cell: tuple[str, str]) -> Chart:
    """Return the rates and, by their units, the margins of a cell over the submissions."""
    names = [one.id.removeprefix(f"{history.name}-") for one in history.submissions]
    pairs = list(zip(names, history.submissions, strict=True))
    rows = [(name, one) for name, each in pairs for one in each.oracles if one.cell == cell]
    fields = ("oracle", "unit", "low", "high", "worst", "median")
    columns = charts.columns_of(fields, [attrgetter(*fields)(one) for _, one in rows]) | {
        "submission": [name for name, _ in rows],
        "rate": [one.passed / one.n for _, one in rows],
        "passed": [f"{one.passed} of {one.n}" for _, one in rows],
        "margins": [_margins_text(one) for _, one in rows],
    }
    colour = charts.colours_of("oracle", list(dict.fromkeys(columns["oracle"])), SERIES, _WIDTH)
    panels = [_panel("pass rate", "rate", ("low", "high"), "passed", colour)]
    for unit in dict.fromkeys(one.unit for _, one in rows if one.median is not None):
        ends = ("worst", "median")
        panel = _panel(f"margin [{unit}]", "median", ends, "margins", colour | {"legend": None})
        panels.append(panel | {"transform": [{"filter": {"field": "unit", "equal": unit}}]})
    x = {"field": "submission", "type": "ordinal", "scale": {"domain": names}, "title": None}
    for panel in panels:
        axis = {"labelAngle": -30} if panel is panels[-1] else {"labels": False}
        panel["encoding"]["x"] = {**x, "axis": axis}
    return {
        "data": charts.table(columns),
        # A click on an entry shows it alone in all panels.
        "params": charts.legend("oracle", "pass rate"),
        "vconcat": panels,
        "spacing": 8,
        "resolve": {"scale": {"color": "independent"}},
    }


def _panel(title: str, field: str, ends: tuple[str, str], hover: str, colour: Chart) -> Chart:
    """Return a panel with a line for each series, and bars from one of ``ends`` to the other."""
    place = {"y": charts.quantity(ends[0], title), "y2": {"field": ends[1]}}
    words = charts.tooltip({"submission": "submission", hover: title})
    opacity = charts.legend_opacity(1.0, 0.1)
    encoding = {"y": charts.quantity(field, title), "tooltip": words, "opacity": opacity}
    bars = charts.layer("rule", None, place, strokeWidth=3, opacity=0.3)
    line = charts.layer("line", None, encoding, name=title, point={"size": 26}, strokeWidth=1.3)
    return {"width": _WIDTH, "height": 80, "encoding": {"color": colour}, "layer": [bars, line]}


def _margins_text(record: OracleRecord) -> str:
    worst, middle = (format_quantity(one, record.unit) for one in (record.worst, record.median))
    return f"{record.oracle}: median {middle}, worst {worst}"
