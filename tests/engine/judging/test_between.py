"""Two campaigns side by side: what changed, what got worse, and what cannot be said.

``shifts.txt`` has gates, each with margins of one oracle before and after and what is found.
"""

from dataclasses import replace
from pathlib import Path

import pytest

from daemon.judging.assessment import JudgedCampaign, compare_campaigns
from daemon.model.assessments import AssessmentRules
from daemon.model.verdicts import Evidence, Outcome, Verdict
from tests.engine.judging.records import cell, measure, record, verdict
from tests.engine.judging.traces import answers
from tests.make import with_result


def judged(name, *records):
    return JudgedCampaign(name, AssessmentRules(), records)


def between(before, after, worse_by=None):
    return compare_campaigns(judged("a", *before), judged("b", *after), worse_by)


def shift(found, quantity):
    return next(s for s in found.shifts if s.quantity == quantity)


def side(words):
    """Runs by their margins; ``open`` is none, ``≥ 9`` only a bound, ``!`` marks a crash."""
    for i, word in enumerate(words.replace("≥ ", "≥").split()):
        if word.startswith("≥"):
            yield record(i, replace(verdict(None), lower=float(word[1:])))
        elif word.startswith("!"):
            yield record(i, verdict(float(word[1:])), ended="crashed")
        else:
            yield record(i, verdict(None if word == "open" else float(word)))


def number(value):
    return "…" if value is None else f"{round(value, 9) + 0.0:.4g}"


def told(gate, line):
    before, after = (tuple(side(words)) for words in line.split(" → "))
    found = between(before, after, gate)
    parts = [
        f"{one.before} {one.passed_before} → {one.after} {one.passed_after}" + " worse" * one.worse
        for one in found.verdicts
    ]
    for one in found.shifts:
        if one.quantity == "clear":
            values = [one.mean, one.low, one.high, one.p, one.delta]
            numbers = "mean {} ({} to {}) {unit}, p {}, delta {}".format(
                *map(number, values), unit=one.unit
            )
            parts.append(f"{number(one.before)} → {number(one.after)} {one.method}, n={one.n}")
            parts.append(numbers + ", changed" * one.changed + ", worse" * one.worse)
    return "; ".join([*parts, "regressed" if found.regressed else "as good"])


def test_each_change_is_what_stands_below_it(golden):
    def gate(name):
        return None if name == "no gate" else float(name)

    golden("shifts.txt", answers(Path(__file__).with_name("shifts.txt"), gate, told))


def test_campaigns_of_other_seeds_are_not_paired():
    strangers = tuple(replace(r, seed=r.seed + 7) for r in cell([0.05, 0.44, 0.86]))
    found = shift(between(cell([0.1, 0.5, 0.9]), strangers), "clear")
    assert (found.method, found.n, found.changed) == ("welch", 3, False)


def test_longer_is_worse_and_measures_are_neither():
    def runs(extra):
        return tuple(
            record(i, verdict(1.0), measure(5.0 + extra), took=100.0 + i + extra) for i in range(4)
        )

    found = between(runs(0.0), runs(20.0), 0.1)
    assert {s.quantity: (s.kind, s.changed, s.worse) for s in found.shifts} == {
        "clear": ("margin", False, False),
        "buffer-time": ("measure", True, False),
        "duration": ("duration", True, True),
    }
    assert not between(runs(20.0), runs(0.0), 0.1).regressed
    assert shift(between(runs(0.0), runs(7.0), 0.06), "duration").worse
    assert not shift(between(runs(0.0), runs(7.0), 0.08), "duration").worse


def test_one_of_many_is_no_finding():
    """A difference that would be significant alone is not among many that are not."""

    def runs(shifted):
        noise = (0.0, 0.1, -0.1, 0.05)
        return [
            record(i, *(verdict(5 + 0.01 * k + noise[(i + k) % 4] * bool(shifted), f"o{k}")
                        for k in range(1, 30)),
                   verdict(5.0 - shifted * (1 + noise[i]), "o0"))
            for i in range(4)
        ]  # fmt: skip

    alone = between([with_result(r, verdicts=r.verdicts[-1:]) for r in runs(0.0)],
                    [with_result(r, verdicts=r.verdicts[-1:]) for r in runs(0.1)])  # fmt: skip
    single, many = shift(alone, "o0"), shift(between(runs(0.0), runs(0.1)), "o0")
    assert many.p > 10 * single.p > 0.0


def test_cells_of_one_side_only_are_named():
    found = between(cell([1.0], scenario="S1"), cell([1.0], scenario="S2"))
    assert (found.only_before, found.only_after) == ((("S1", "a2s"),), (("S2", "a2s"),))
    assert found.shifts == ()


def test_a_verdict_of_one_side_only_is_not_worse():
    added = [record(0, verdict(1.0), verdict(-1.0, "new"))]
    (change,) = between(cell([1.0]), added).verdicts
    assert (change.oracle, change.before, change.after) == ("new", None, "fail")
    assert (change.passed_before, change.passed_after, change.worse) == ("", "0/1", False)
    (gone,) = between(added, cell([1.0])).verdicts
    assert (gone.after, gone.passed_before, gone.passed_after) == (None, "0/1", "")


@pytest.mark.parametrize("broken", [0, 4])
@pytest.mark.parametrize("made", [measure, verdict])
def test_a_run_without_a_valid_trace_leaves_the_quantities_of_the_others(broken, made):
    def runs(value):
        return [record(i, made(value + 0.1 * i, "seen")) for i in range(5)]

    invalid = Evidence(note="invalid trace: no clock")
    error = Verdict("seen", "…", Outcome.ERROR, None, None, "", invalid)
    after = runs(3.0)
    after[broken] = record(broken, error, outcome=Outcome.ERROR)
    found = shift(between(runs(2.0), after), "seen")
    kind = "measure" if made is measure else "margin"
    assert (found.kind, found.unit, found.n) == (kind, made(1.0).unit, 4)
