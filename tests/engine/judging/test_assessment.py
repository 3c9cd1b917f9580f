"""Repeats judged together: cells, expectations, surprises and marks.

``cells.txt`` has policies, each with repeats of one cell and what they come to.
"""

import random
from dataclasses import replace
from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st

from daemon.judging.assessment import assess, evidence_text, find_marks, undecided_cells
from daemon.model.assessments import AssessmentRules, Expectation, Mark, RepeatPolicy
from daemon.model.verdicts import Evidence, Outcome, Verdict
from grammars.text import codec
from tests.engine.judging.records import cell, lost, measure, record, verdict
from tests.engine.judging.traces import answers

RATE = AssessmentRules(RepeatPolicy(5, "rate", 0.8))
PLAIN = AssessmentRules()


def expecting(wanted, policy=RepeatPolicy(), **changes):  # noqa: B008
    base = Expectation("S1", "clear", (), wanted, "it is narrow")
    return AssessmentRules(policy, expectations=(replace(base, **changes),))


POLICIES = {
    "all": AssessmentRules(),
    "rate": RATE,
    "rate in four looks": AssessmentRules(
        RepeatPolicy(5, "rate", 0.8, until_decided=True, at_most=30)
    ),
    "mean": AssessmentRules(RepeatPolicy(5, "mean")),
    "mean in four looks": AssessmentRules(
        RepeatPolicy(5, "mean", until_decided=True, at_most=30)
    ),
    **{f"expects {wanted}": expecting(wanted) for wanted in ("pass", "fail", "mixed", "any")},
    **{
        f"expects fail of {of}": expecting("fail", **changes)
        for of, changes in {
            "S*": {"scenario": "S*"},
            "c* in *": {"scenario": "*", "oracle": "c*"},
            "b": {"suts": ("b",)},
            "b or a2*": {"suts": ("b", "a2*")},
        }.items()
    },
    "expects fail, then pass": replace(
        PLAIN, expectations=(Expectation("S1", "*", (), "fail", "it is narrow"),
                             Expectation("*", "*", (), "pass", "all is well")),
    ),
    "rate of 50 %, expects pass": expecting("pass", RepeatPolicy(21, "rate", 0.5)),
    "rate of 80 %, expects any": expecting("any", RATE.policy),
}  # fmt: skip
HERE = Path(__file__).parent
ERROR = Verdict("clear", "always(...)", Outcome.ERROR, None, None, "m", Evidence())


def repeats(line):
    """Runs of one cell: a margin for each, ``n × margin`` for several, or what came of it."""
    runs = []
    for word in line.split(", "):
        count, _, what = word.rpartition(" × ")
        for _ in range(int(count or 1)):
            at = len(runs)
            if what in ("lost", "cancelled", "queued"):
                runs.append(lost(at, what))
            elif what == "crashed":
                end = {"outcome": Outcome.ERROR, "ended": "crashed", "note": "division"}
                runs.append(record(at, verdict(0.1), **end))
            else:
                made = {
                    "error": ERROR,
                    "open": verdict(None),
                    "at least 1": replace(verdict(None), lower=1.0),
                    "fails": replace(verdict(-0.1), upper=None),
                }
                runs.append(record(at, made[what] if what in made else verdict(float(what))))
    return tuple(runs)


def expectations(rules, found, runs):
    """What came of an expectation: its status, the surprise, the marks of cell and runs."""
    ((only,),) = (each.oracles for each in found.cells)
    marks = find_marks(rules, found, runs)
    signs = [f"{m.kind} {m.letter}" if m.kind else "-" for m in map(marks.mark, runs)]
    cell = marks.mark_cells(found.cells)
    yield f"{only.status}, marked {f'{cell.kind} {cell.letter} {cell.reason}'.strip() or '-'}"
    yield f"runs {', '.join(signs)}"
    for one in found.surprises:
        yield f"surprise in {one.run}, {one.repeat}, {one.why}: {one.text}"


def told(rules, line):
    variant, _, margins = line.rpartition(" of ")
    runs = tuple(replace(run, scenario=variant or run.scenario) for run in repeats(margins))
    found = assess(rules, runs)
    ((only,),) = (each.oracles for each in found.cells)
    counts = (only.passed, only.failed, only.inconclusive, only.errors, only.missing)
    names = ("passed", "failed", "open", "in error", "missing")
    parts = [
        f"{only.verdict}, exit code {found.exit_code}",
        " ".join(f"{n} {name}" for n, name in zip(counts, names, strict=True) if n),
        f"rate {only.low:.6f} to {only.high:.6f}, at least {only.at_least:.6f}",
        only.statement,
    ]
    if only.needed is not None:
        parts.append(f"needs {only.needed}")
    if only.worst is not None:
        seen = evidence_text(only.worst.verdict)
        parts.append(f"look at {only.worst.repeat}: {seen}".removesuffix(": "))
    if undecided_cells(rules, runs):
        parts.append("is repeated")
    if rules.expectations:
        parts += expectations(rules, found, runs)
    return "; ".join(parts)


def test_each_cell_comes_to_what_stands_below_its_repeats(golden):
    golden("cells.txt", answers(HERE / "cells.txt", POLICIES.get, told))


def test_a_mean_that_is_looked_at_more_often_needs_more():
    # 2.132 and 3.495 are Student's t for 4 degrees of freedom, one-sided 5 % and 1.25 %.
    for name, shown in (("mean", 2.132 * 0.5**0.5), ("mean in four looks", 3.495 * 0.5**0.5)):

        def judged(sign, by, name=name, shown=shown):
            margins = [sign * (shown + by + d) for d in (-2.0, -1.0, 0.0, 1.0, 2.0)]
            return assess(POLICIES[name], cell(margins)).cells[0].verdict

        assert (judged(1, 0.01), judged(1, -0.01)) == (Outcome.PASS, Outcome.INCONCLUSIVE)
        assert judged(-1, 0.01) is Outcome.FAIL


def test_the_passing_run_that_surprises_is_of_the_same_cell_and_oracle():
    runs = (
        *cell([1.0], scenario="S0"),
        *cell([1.0], sut="b"),
        record(0, verdict(1.0, "near"), verdict(-1.0)),
        record(1, verdict(1.0, "near"), verdict(None)),
        record(2, verdict(1.0, "near"), verdict(1.0)),
    )
    (found,) = assess(expecting("fail", suts=("a2s",)), runs).surprises
    assert (found.run, found.repeat) == ("c.S1-a2s-2", 2)
    assert (found.scenario, found.sut, found.oracle) == ("S1", "a2s", "clear")


def test_evidence_is_told_as_far_as_it_goes():
    seen = Evidence(time=12.34, object="door-17", note="last pose")
    full = Verdict("o", "always(...)", Outcome.FAIL, -0.25, -0.25, "m", seen)
    assert evidence_text(full) == "−0.25 m  at 12.3 s  door-17  last pose"
    assert evidence_text(replace(full, unit="1", evidence=Evidence())) == "−0.25"
    assert evidence_text(replace(full, unit="", upper=0.5, evidence=Evidence(time=0.0))) == (
        "+0.5  at 0.0 s"
    )
    assert evidence_text(replace(full, upper=None)) == "at 12.3 s  door-17  last pose"


@pytest.mark.parametrize(
    ("runs", "expected"),
    [
        ((record(0, measure(1.0)), lost(1)), Outcome.ERROR),
        ((record(0, measure(1.0)), record(1, measure(1.0), outcome=Outcome.ERROR)), Outcome.ERROR),
        ((record(0, measure(1.0)), lost(1, "queued")), Outcome.INCONCLUSIVE),
    ],
)
def test_a_cell_without_oracles_is_as_its_runs_were(runs, expected):
    assert assess(PLAIN, runs).cells[0].verdict is expected


def test_what_judges_nothing_decides_nothing():
    silent = (record(0, measure(1.0), scenario="S2"),)
    for runs in ((), silent, (*cell([1.0]), *silent)):
        assert assess(PLAIN, runs).exit_code == 4


def test_a_cell_is_called_by_its_gravest_oracle():
    error, good = replace(ERROR, oracle="seen"), verdict(1.0, "a")
    bad, open_yet = verdict(-1.0, "b"), verdict(None, "c")
    for verdicts, expected in (
        ((good, error, bad, open_yet), Outcome.FAIL),
        ((good, open_yet, error), Outcome.ERROR),
        ((good, open_yet), Outcome.INCONCLUSIVE),
        ((good, verdict(0.0, "d")), Outcome.PASS),
    ):
        (found,) = assess(PLAIN, (record(0, *verdicts),)).cells
        assert found.verdict is expected
        assert [o.oracle for o in found.oracles] == [v.oracle for v in verdicts]


def test_measures_are_told_with_their_interval():
    runs = tuple(record(i, verdict(1.0), measure(x), took=70.0 + i) for i, x in enumerate((2, 4)))
    buffer, duration = assess(PLAIN, runs).cells[0].measures
    assert (buffer.oracle, buffer.values, buffer.mean) == ("buffer-time", (2.0, 4.0), 3.0)
    assert buffer.std == pytest.approx(2**0.5)
    assert buffer.low == pytest.approx(3.0 - 12.706, abs=1e-3)
    assert (duration.oracle, duration.unit, duration.values) == ("duration", "s", (70.0, 71.0))
    assert (buffer.unit, buffer.repeats, duration.repeats) == ("s", (0, 1), (0, 1))


def test_only_runs_that_have_a_value_are_measured():
    broken = replace(ERROR, oracle="buffer-time")
    runs = (
        record(0, measure(2.0), verdict(1.0, "far"), ended="crashed"),
        record(1, verdict(1.0, "far")),
        record(2, measure(4.0)),
        lost(3),
        record(4, broken, ended="crashed"),
    )
    (found,) = assess(PLAIN, runs).cells
    assert {m.oracle: (m.repeats, m.values) for m in found.measures} == {
        "buffer-time": ((2,), (4.0,)),
        "duration": ((1, 2), (60.0, 60.0)),
    }
    assert [oracle.oracle for oracle in found.oracles] == ["far"]
    # A measure of this name takes the place of the one that every run has.
    own = record(0, measure(7.0, "duration", "1"), took=60.0)
    (only_one,) = assess(PLAIN, (own,)).cells[0].measures
    assert (only_one.unit, only_one.values) == ("1", (7.0,))


margins = st.lists(st.one_of(st.none(), st.floats(-1, 1)), min_size=1, max_size=8)
policies = st.sampled_from([RepeatPolicy(), RepeatPolicy(5, "rate", 0.5), RepeatPolicy(5, "mean")])


@given(margins, policies, st.integers(0, 99))
def test_the_order_of_records_does_not_matter(found, policy, seed):
    runs = list(cell(found))
    there = assess(AssessmentRules(policy), runs)
    random.Random(seed).shuffle(runs)
    assert assess(AssessmentRules(policy), runs) == there
    assert codec.from_json(type(there), codec.to_json(there)) == there


@given(margins, policies)
def test_a_better_margin_never_turns_a_pass_into_a_failure(found, policy):
    better = [None if m is None else m + 0.2 for m in found]
    before, after = (
        assess(AssessmentRules(policy), cell(side)).cells[0].verdict for side in (found, better)
    )
    assert not (before is Outcome.PASS and after is Outcome.FAIL)
    assert policy.rule == "mean" or before is not Outcome.PASS or after is Outcome.PASS


def test_one_failure_that_is_not_known_makes_the_run_news():
    rules, run = expecting("fail"), record(0, verdict(-0.1), verdict(-0.1, oracle="reached"))
    assessment = assess(rules, [run])
    marks, news = find_marks(rules, assessment, [run]), Mark("news", "!a", "expected pass")
    assert marks.mark_cells(assessment.cells[:1]) == marks.mark(run) == news


def test_only_cells_that_more_repeats_can_decide_are_repeated():
    other = cell([0.1] * 3, scenario="S2")
    assert undecided_cells(RATE, (*cell([0.1] * 14), *other)) == (("S2", "a2s"),)
