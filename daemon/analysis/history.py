"""The history of a campaign: its submissions side by side, and what changed between them.

All of it is of the ledger: results, specifications, declarations. No trace is read.
"""

from __future__ import annotations

import json
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from statistics import median
from typing import Final, TypeAlias

from daemon.judging.assessment import (
    JudgedCampaign,
    QuantityChange,
    VerdictChange,
    assess,
    compare_campaigns,
)
from daemon.model.assessments import AssessmentRules, CellAssessment, CellVerdict
from daemon.model.spec import OracleText, RunSpec
from daemon.model.status import CampaignRow, RunRow
from daemon.model.submission import CampaignOrigin
from daemon.model.verbs import CampaignSource
from daemon.model.verdicts import Outcome
from grammars.text import codec
from grammars.text.words import count_noun, enumerate_words, format_quantity

_LONGEST: Final = 60
"""Characters of a value that is told as it was and as it is; of a longer one, that it changed."""
_MOST_NAMED: Final = 3
_SHOWN_OF_HASH: Final = 12

Setup: TypeAlias = Mapping[str, Mapping[str, str]]
"""What a submission was made of: aspects and their values, by subject (``system pilot``)."""


@dataclass(frozen=True, slots=True)
class OracleRecord:
    """An oracle of a cell in one submission: how many of ``n`` repeats pass, and by how much.

    ``low`` to ``high`` is the exact 95 % interval of the rate. ``worst`` and ``median`` are margins
    [``unit``] of repeats that pass or fail, ``None`` where no repeat has one.
    """

    name: str
    unit: str
    verdict: str
    passed: int
    n: int
    low: float
    high: float
    worst: float | None
    median: float | None


@dataclass(frozen=True, slots=True)
class CellRecord:
    """A scenario with a system in one submission; ``duration`` and ``cpu`` are medians [s]."""

    scenario: str
    sut: str
    oracles: tuple[OracleRecord, ...]
    duration: float | None
    cpu: float | None


@dataclass(frozen=True, slots=True)
class SubmissionRecord:
    """A submission of a campaign, and what is different from the one before.

    ``cpu`` [s] is what its runs took, without results that were there already. ``changes`` are of
    what it was made of, ``verdicts`` of what came out. ``quantities`` are margins, measures and
    durations that differ by more than chance.
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
    cells: tuple[CellRecord, ...]
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
        """One sentence about the newest submission: what is new since the one before."""
        newest = self.submissions[-1]
        if len(self.submissions) == 1:
            return f"{newest.id} is the only submission of {self.name}: nothing to compare yet"
        before = self.submissions[-2].id
        count = sum(len(cell.oracles) for cell in newest.cells)
        if newest.verdicts:
            told = [verdict_words(change) for change in newest.verdicts[:_MOST_NAMED]]
            more = len(newest.verdicts) - len(told)
            words = enumerate_words([*told, f"{more} more"] if more else told)
            changed = len(newest.verdicts)
            return f"{changed} of {count_noun(count, 'verdict')} changed since {before}: {words}"
        same = f"none of {count_noun(count, 'verdict')} changed since {before}"
        if not newest.quantities:
            return same
        quantities = [quantity_words(change) for change in newest.quantities[:_MOST_NAMED]]
        more = len(newest.quantities) - len(quantities)
        words = enumerate_words([*quantities, f"{more} more"] if more else quantities)
        return f"{same}, but values did: {words}"

    @property
    def cells(self) -> tuple[tuple[str, str], ...]:
        """The scenarios with their systems that some submission has, the newest ones first."""
        cells = [
            (cell.scenario, cell.sut)
            for submission in reversed(self.submissions)
            for cell in submission.cells
        ]
        return tuple(dict.fromkeys(cells))


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
    """Return the history of the campaigns of a name; searches of that name are none.

    Raises :class:`daemon.batch.errors.DaemonError` where a ledger or daemon cannot be asked.
    """
    rows = [row for row in source.campaign_page(name=name) if not row.search]
    submissions: list[SubmissionRecord] = []
    before: tuple[JudgedCampaign, Setup] | None = None
    for row in sorted(rows, key=lambda row: row.submitted_at):
        records = source.all_runs(row.id, results=True)
        judged = JudgedCampaign(row.id, source.declared(row.id), records)
        # Repeats of a cell differ by their seeds alone: the first of each stands for all.
        firsts = {(one.scenario, one.sut): one.id for one in reversed(records)}
        specs = [source.run(run).spec for run in reversed(firsts.values())]
        origin = source.origin(row.id)
        setup = _setup(judged, origin, specs)
        submissions.append(_submission(row, judged, origin, before, setup))
        before = (judged, setup)
    return CampaignHistory(name, tuple(submissions))


def _submission(
    row: CampaignRow,
    judged: JudgedCampaign,
    origin: CampaignOrigin,
    before: tuple[JudgedCampaign, Setup] | None,
    setup: Setup,
) -> SubmissionRecord:
    assessment = assess(judged.declared, judged.records)
    changes: tuple[str, ...] = ()
    verdicts: tuple[VerdictChange, ...] = ()
    quantities: tuple[QuantityChange, ...] = ()
    if before is not None:
        changes = tuple(_changes(before[1], setup))
        difference = compare_campaigns(before[0], judged)
        verdicts = difference.verdicts
        quantities = tuple(shift for shift in difference.shifts if shift.changed)
    return SubmissionRecord(
        id=row.id,
        submitted_at=row.submitted_at,
        runs=len(judged.records),
        unfinished=sum(not record.settled for record in judged.records),
        as_expected=assessment.exit_code == 0,
        commit=origin.commit,
        branch=origin.branch,
        uncommitted=origin.changed,
        machines=_machines(judged.records),
        cpu=sum(cpu for record in judged.records if (cpu := _cpu(record)) and not record.cached),
        cells=tuple(_cell(cell, judged.records) for cell in assessment.cells),
        changes=changes,
        verdicts=verdicts,
        quantities=quantities,
    )


def _cell(cell: CellAssessment, records: Iterable[RunRow]) -> CellRecord:
    runs = [one for one in records if (one.scenario, one.sut) == (cell.scenario, cell.sut)]
    results = [one.result for one in runs if one.result is not None]
    return CellRecord(
        cell.scenario,
        cell.sut,
        tuple(_oracle(oracle, runs) for oracle in cell.oracles),
        _median([result.timing.simulated for result in results]),
        _median([result.timing.cpu for result in results]),
    )


def _oracle(oracle: CellVerdict, runs: Iterable[RunRow]) -> OracleRecord:
    verdicts = [one.verdict(oracle.oracle) for one in runs if one.ended != "crashed"]
    judged = [one for one in verdicts if one and one.outcome in (Outcome.PASS, Outcome.FAIL)]
    # Margins without a unit only say true or false.
    margins = [one.margin for one in judged if one.margin is not None and one.unit]
    return OracleRecord(
        name=oracle.oracle,
        unit=next((one.unit for one in judged), ""),
        verdict=oracle.word,
        passed=oracle.passed,
        n=oracle.n,
        low=oracle.low,
        high=oracle.high,
        worst=min(margins, default=None),
        median=_median(margins),
    )


def _median(values: Sequence[float]) -> float | None:
    return median(values) if values else None


def _cpu(record: RunRow) -> float:
    return record.result.timing.cpu if record.result is not None else 0.0


def _machines(records: Iterable[RunRow]) -> tuple[str, ...]:
    names = {record.result.machine for record in records if record.result is not None}
    return tuple(sorted(filter(None, names)))


def _setup(judged: JudgedCampaign, origin: CampaignOrigin, specs: Sequence[RunSpec]) -> Setup:
    uncommitted = " with uncommitted changes" if origin.changed else ""
    setup: dict[str, dict[str, str]] = {
        "": {
            "campaign file": origin.digest,
            "commit": f"{origin.commit[:_SHOWN_OF_HASH]}{uncommitted}" if origin.commit else "",
            "branch": origin.branch,
            "seed": "" if origin.seed is None else str(origin.seed),
            "engine": ", ".join(sorted({spec.engine for spec in specs})),
            "machine": ", ".join(_machines(judged.records)),
            **_rules(judged.declared),
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
            **{_oracle_name(oracle): oracle.text for oracle in spec.oracles},
        }
    return setup


def _oracle_name(oracle: OracleText) -> str:
    return f"oracle {oracle.name}"


def _rules(declared: AssessmentRules) -> dict[str, str]:
    policy = declared.policy
    return {
        "repeats": str(policy.n),
        "policy": f"{policy.rule} {policy.rate:g}" if policy.rule == "rate" else policy.rule,
        "expectations": codec.digest(declared.expectations),
        "comparisons": codec.digest(declared.comparisons),
    }


def _changes(before: Setup, after: Setup) -> Iterator[str]:
    """Yield what came, went or changed; the same change of several subjects is told once."""
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
        named = names if len(names) <= _MOST_NAMED else [*names[:2], f"{len(names) - 2} more"]
        about = enumerate_words(named)
        yield f"{about}: {words}" if about else words


def _change_words(aspect: str, old: str, new: str) -> str:
    if old == new:
        return ""
    if not old or not new:
        value = old or new
        shown = f" ({value})" if len(value) < _LONGEST else ""
        return f"{aspect} {'came' if new else 'went'}{shown}"
    if max(len(old), len(new)) > _LONGEST:
        return f"{aspect} changed"
    return f"{aspect} {old} → {new}"
