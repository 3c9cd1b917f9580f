"""One oracle over the repeats of a cell: counts, what they show, the verdict of the policy."""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence
from typing import Final

from daemon.assessment._expected import Standing, expected, standing
from daemon.assessment._types import Declared, OracleCell, Policy, RunRecord, Worst
from daemon.statistics import at_least, at_most, mean_interval, proportion_interval, runs_needed
from daemon.verdict import Evidence, Outcome, Verdict

GRAVITY: Final = (Outcome.FAIL, Outcome.ERROR, Outcome.INCONCLUSIVE, Outcome.PASS)
_CONFIDENCE: Final = 0.95


def judged(record: RunRecord) -> tuple[Verdict, ...]:
    """Return the verdicts of a run as they count: none is trusted when its system crashed."""
    if record.ended != "crashed":
        return record.verdicts
    return tuple(_distrusted(verdict, record.note) for verdict in record.verdicts)


def _distrusted(verdict: Verdict, note: str) -> Verdict:
    evidence = Evidence(note=note)
    return Verdict(verdict.oracle, verdict.text, Outcome.ERROR, None, None, verdict.unit, evidence)


def oracle_cell(
    name: str, records: Sequence[RunRecord], declared: Declared
) -> tuple[OracleCell, Standing]:
    """Return what the oracle ``name`` says about the repeats of one cell."""
    found = [(r, v) for r in records for v in judged(r) if v.oracle == name]
    verdicts = [v for _, v in found]
    counts, n = Counter(v.outcome for v in verdicts), len(records)
    passed, failed = counts[Outcome.PASS], counts[Outcome.FAIL]
    policy = declared.policy
    verdict = _verdict(policy, verdicts, n)
    scenario, sut = records[0].scenario, records[0].sut
    wanted, why = expected(declared.expectations, scenario, name, sut)
    stands = standing(wanted, verdict, passed=passed, failed=failed, n=n)
    confidence = confidence_of(policy)
    needed = runs_needed(passed, n, policy.rate, confidence) if policy.rule == "rate" else None
    cell = OracleCell(
        scenario=scenario,
        sut=sut,
        oracle=name,
        passed=passed,
        failed=failed,
        inconclusive=counts[Outcome.INCONCLUSIVE],
        errors=counts[Outcome.ERROR],
        missing=n - len(verdicts),
        n=n,
        low=proportion_interval(passed, n)[0],
        high=proportion_interval(n - failed, n)[1],
        at_least=at_least(passed, n, confidence),
        needed=needed,
        statement=_statement(policy, passed, failed, n, needed),
        worst=_worst(found),
        verdict=verdict,
        expected=wanted,
        met=stands is Standing.MET,
        why=why,
    )
    return cell, stands


def confidence_of(policy: Policy) -> float:
    """Return the confidence of each look at a cell.

    Whoever looks again and again until something shows finds it by chance: with ``k`` looks each
    may err in 5 %/k (Bonferroni), so that all of them together err in at most 5 %.
    """
    return 1.0 - (1.0 - _CONFIDENCE) / len(policy.looks)


def _verdict(policy: Policy, verdicts: Sequence[Verdict], n: int) -> Outcome:
    counts = Counter(v.outcome for v in verdicts)
    if policy.rule == "all":
        found = [outcome for outcome in GRAVITY[:3] if counts[outcome]]
        if found and found[0] is not Outcome.INCONCLUSIVE:
            return found[0]
        return Outcome.PASS if counts[Outcome.PASS] == n else Outcome.INCONCLUSIVE
    shown = _rate(policy, counts, n) if policy.rule == "rate" else _mean(policy, verdicts, n)
    undecided = shown is Outcome.INCONCLUSIVE
    return Outcome.ERROR if undecided and counts[Outcome.ERROR] else shown


def _rate(policy: Policy, counts: Counter[Outcome], n: int) -> Outcome:
    """Judge by the rate that is shown; a repeat that was not judged may have been either."""
    confidence = confidence_of(policy)
    if at_least(counts[Outcome.PASS], n, confidence) >= policy.rate:
        return Outcome.PASS
    if at_most(n - counts[Outcome.FAIL], n, confidence) < policy.rate:
        return Outcome.FAIL
    return Outcome.INCONCLUSIVE


def _mean(policy: Policy, verdicts: Sequence[Verdict], n: int) -> Outcome:
    """Judge by the mean margin; one that is not known leaves everything open."""
    margins = [
        v.margin
        for v in verdicts
        if v.margin is not None and v.outcome in (Outcome.PASS, Outcome.FAIL)
    ]
    if len(margins) < max(n, 2):
        return Outcome.INCONCLUSIVE
    # A bound of a two-sided interval is a one-sided bound with half the doubt.
    interval = mean_interval(margins, 2.0 * confidence_of(policy) - 1.0)
    if interval.low is not None and interval.low >= 0.0:
        return Outcome.PASS
    if interval.high is not None and interval.high < 0.0:
        return Outcome.FAIL
    return Outcome.INCONCLUSIVE


def _statement(policy: Policy, passed: int, failed: int, n: int, needed: int | None) -> str:
    confidence = confidence_of(policy)
    if failed == n:
        text = f"{passed} of {n} shows at most {_percent(at_most(0, n, confidence))}"
    else:
        text = f"{passed} of {n} shows at least {_percent(at_least(passed, n, confidence))}"
    if policy.rule != "rate":
        return text
    most = at_most(n - failed, n, confidence)
    if most < policy.rate:
        text += f", at most {_percent(most)}" if failed < n else ""
        text += f": less than {_percent(policy.rate)}"
    elif needed:
        runs = "1 more run" if needed == 1 else f"{needed} more runs"
        text += f", {runs} needed for {_percent(policy.rate)}"
    looks = len(policy.looks)
    return f"{text} ({looks} looks)" if looks > 1 else text


def _percent(rate: float) -> str:
    """Return ``54.9 %``, cut and not rounded: nothing is shown that was not."""
    return f"{int(rate * 1000 + 1e-9) / 10:g} %"


def _worst(found: Sequence[tuple[RunRecord, Verdict]]) -> Worst | None:
    if not found:
        return None
    record, verdict = min(found, key=lambda pair: _severity(pair[1]))
    return Worst(record.id, record.repeat, verdict)


def _severity(verdict: Verdict) -> tuple[int, bool, float]:
    margin = verdict.margin
    return GRAVITY.index(verdict.outcome), margin is None, margin or 0.0
