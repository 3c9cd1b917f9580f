"""Scenarios and campaigns compared, and reference values beside what runs gave.

``comparisons.txt`` has sentences, each with runs of A and B, and what they come to; ``shifts.txt``
gates, each with margins of one oracle before and after, and what is found.
"""

from dataclasses import replace
from pathlib import Path

import pytest

from daemon.judging.assessment import (
    JudgedCampaign,
    assess,
    compare_campaigns,
    reference_comparisons,
)
from daemon.model.assessments import (
    AssessmentRules,
    Expectation,
    ReferenceValue,
    ScenarioComparison,
)
from daemon.model.verdicts import Evidence, Outcome, Verdict
from tests.engine.judging.records import cell, measure, record, timed, verdict
from tests.engine.judging.test_verdicts import number
from tests.engine.judging.traces import answers
from tests.make import with_result

GOLDEN = "comparisons.txt"


def sentence(quantity="delay", op="<=", limit=30.0):
    text = f"{quantity}(A vs B) {op} {limit:g} s"
    declared = ScenarioComparison("d", quantity, "A", "B", None, op, limit, "s", text)
    return AssessmentRules(comparisons=(declared,))


def declared(words):
    words, _, expected = words.partition(", expecting ")
    quantity, op, limit = words.split()
    rules = sentence(quantity, op, float(limit))
    known = Expectation("A", "d", (), expected, "the detour")
    return replace(rules, expectations=(known,) if expected else ())


def side(rules, words):
    """Runs of a scenario: by their time or measure, or how they ended."""
    *other, name = words[: words.index("A" if "A" in words else "B") + 1].split()
    measured = rules.comparisons[0].quantity != "delay"
    for i, word in enumerate(words.split()[len(other) + 1 :]):
        seed = {"scenario": name, "seed": i + 100 * bool(other)}
        if word == "missed":
            yield record(i, verdict(-1.0, "reached", "reached(mission, 0.25 m)"), **seed)
        elif word in ("limit", "none"):
            yield record(i, *([verdict(1.0)] if word == "limit" else []), ended="limit", **seed)
        elif measured:
            yield record(i, measure(float(word)), **seed)
        else:
            yield record(i, verdict(1.0), took=float(word), **seed)


def told(rules, line):
    runs = [run for words in line.split(", ") for run in side(rules, words)]
    result = assess(rules, tuple(runs))
    (found,) = result.comparisons
    differences = " ".join(f"{value:g}" for value in found.differences)
    numbers = [
        f"{name} {value:.4g}"
        for name in ("mean", "low", "high")
        if (value := getattr(found, name)) is not None
    ]
    parts = [f"{found.verdict} {found.method}".rstrip(), f"n={found.n}", *numbers]
    parts += [f"differences {differences}"] if differences else []
    parts += [f"{found.left_out} left out"] if found.left_out else []
    if rules.expectations:
        parts.append(f"{found.status} {found.why}, exit code {result.exit_code}")
        parts += [f"surprise {one.text}" for one in result.surprises]
    return ", ".join([*parts, *filter(None, [found.note])])


def test_each_comparison_comes_to_what_stands_below_its_runs(golden):
    golden(GOLDEN, answers(Path(__file__).with_name(GOLDEN), declared, told))


def compared(rules, *sides):
    (found,) = assess(rules, sum(sides, ())).comparisons
    return found


@pytest.mark.parametrize(
    ("text", "counts"),
    [
        ("reached(mission, 0.25 m)", True),
        ("reached (mission, 0.25 m)", True),
        ("  reached\n  ( mission , 0.25 m )", True),
        ("reached(mission, 0.25 m) when speed < 1 m/s", True),
        ("always(mission.reached >= 0)", False),
        ("a_plugin_that_is_not_here(3)", False),
    ],
)
def test_a_mission_that_was_missed_is_known_however_its_oracle_is_written(text, counts):
    missed = tuple(
        record(i, verdict(-1.0, "arrives", text), scenario="A", took=20.0) for i in range(5)
    )
    found = compared(sentence(), missed, timed("B", [100] * 5))
    assert found.left_out == (5 if counts else 0)
    assert found.verdict is (Outcome.INCONCLUSIVE if counts else Outcome.PASS)


def apart(*by):
    """Runs of A that take so much longer [s] than their pairs of B."""
    return timed("A", [100 + x for x in by]), timed("B", [100] * len(by))


def test_the_delay_of_a_leg_is_that_of_the_measure_that_times_it():
    (whole,) = sentence().comparisons
    leg = AssessmentRules(comparisons=(replace(whole, measure="leg"),))
    runs = [
        record(i, measure(time, "leg"), scenario=name, took=900.0 - time)
        for name, times in (("A", (18.0, 28.0)), ("B", (10.0, 20.0)))
        for i, time in enumerate(times)
    ]
    assert compared(leg, tuple(runs)).differences == (8.0, 8.0)
    # A leg that was timed in a run that ended before its mission did is no delay.
    runs[1] = with_result(runs[1], ended="limit")
    assert compared(leg, tuple(runs)).left_out == 1


def test_variants_are_paired_with_their_like():
    sides = [
        record(0, verdict(1.0), scenario=f"{name}@{variant}", took=took)
        for name, variant, took in (("A", 1, 111), ("A", 2, 222), ("B", 2, 220), ("B", 1, 110))
    ]
    assert compared(sentence(), tuple(sides)).differences == (1.0, 2.0)


def test_every_system_that_ran_both_scenarios_is_compared():
    def runs(sut, scenario, by):
        return tuple(replace(r, sut=sut) for r in timed(scenario, [100 + by, 102 + by]))

    records = (
        *runs("slow", "A", 50), *runs("fast", "A", 5), *runs("alone", "A", 5),
        *runs("fast", "B", 0), *runs("slow", "B", 0), *runs("slow", "C", 0),
    )  # fmt: skip
    found = assess(sentence(), records).comparisons
    assert [(c.sut, c.verdict, c.mean) for c in found] == [
        ("slow", "fail", 50.0),
        ("fast", "pass", 5.0),
    ]


def reference(oracle, value, **other):
    given = {"scenario": "S1", "suts": (), "statistic": "mean", "unit": "s"} | other
    return ReferenceValue(
        name="paper", source="a paper", oracle=oracle, value=value, text=f"{value}", **given
    )


DELAY = ScenarioComparison("delay-1", "delay", "S2", "S1", None, "<=", 30.0, "s", "delay(...)")
PAIRS = (*timed("S1", (60.0, 61.0)), *timed("S2", (70.0, 73.0)))
MEASURED = tuple(record(i, verdict(1.0), measure(v)) for i, v in enumerate((2.0, 9.0, 1.0)))
VARIED = (
    *timed("S3.1", (1.0, 2.0)),
    *timed("S3.2@7", (3.0, 4.0)),
    *timed("S3.1", (5.0, 6.0), sut="fro-diff"),
    *timed("S1", (7.0, 8.0)),
)
RATE = {"statistic": "rate", "unit": "1"}
REFERENCES = {
    "a mean has a deviation and the t interval": (
        reference("duration", 61.0), timed("S1", (60.0, 62.0, 67.0))
    ),
    "other statistics have no interval: min": (
        reference("buffer-time", 0.5, statistic="min"), MEASURED
    ),
    "median": (reference("buffer-time", 0.5, statistic="median"), MEASURED),
    "max": (reference("buffer-time", 0.5, statistic="max"), MEASURED),
    "a count has the exact interval of its rate": (
        reference("clear", 0.6, **RATE), cell((1.0, 1.0, -1.0, 1.0))
    ),
    "a run that was not judged may have been either": (
        reference("clear", 1.0, **RATE), cell((1.0, None))
    ),
    "a comparison stands beside its pairs": (reference("delay-1", -8.9, scenario=""), PAIRS),
    "patterns speak of several cells and of variants": (
        reference("duration", 0.0, scenario="S3.?", suts=("a2s",)), VARIED
    ),
    "what nobody measured is said so": (reference("buffer-time", 3.0), cell((1.0,))),
}  # fmt: skip


def test_reference_values_stand_beside_what_runs_gave(golden):
    lines = []
    for about, (wanted, runs) in REFERENCES.items():
        assessment = assess(AssessmentRules(comparisons=(DELAY,)), runs)
        lines.append(f"== {about}")
        for one in reference_comparisons([wanted], assessment):
            numbers = ", ".join(
                f"{name} {number(getattr(one, name))}"
                for name in ("value", "deviation", "low", "high", "difference")
            )
            lines.append(f"{one.scenario or 'no scenario'} {one.sut}, n={one.n}, {numbers}")
    golden("references.txt", "\n".join([*lines, ""]))


def judged(name, *records):
    return JudgedCampaign(name, AssessmentRules(), records)


def between(before, after, worse_by=None):
    return compare_campaigns(judged("a", *before), judged("b", *after), worse_by)


def shift(found, quantity):
    return next(s for s in found.shifts if s.quantity == quantity)


def margins(words):
    """Runs by their margins; ``open`` is none, ``≥ 9`` only a bound, ``!`` marks a crash."""
    for i, word in enumerate(words.replace("≥ ", "≥").split()):
        if word.startswith("≥"):
            yield record(i, replace(verdict(None), lower=float(word[1:])))
        elif word.startswith("!"):
            yield record(i, verdict(float(word[1:])), ended="crashed")
        else:
            yield record(i, verdict(None if word == "open" else float(word)))


def short(value):
    return "…" if value is None else f"{round(value, 9) + 0.0:.4g}"


def shifted(gate, line):
    before, after = (tuple(margins(words)) for words in line.split(" → "))
    found = between(before, after, gate)
    parts = [
        f"{one.before} {one.passed_before} → {one.after} {one.passed_after}" + " worse" * one.worse
        for one in found.verdicts
    ]
    for one in found.shifts:
        if one.quantity == "clear":
            values = [one.mean, one.low, one.high, one.p, one.delta]
            numbers = "mean {} ({} to {}) {unit}, p {}, delta {}".format(
                *map(short, values), unit=one.unit
            )
            parts.append(f"{short(one.before)} → {short(one.after)} {one.method}, n={one.n}")
            parts.append(numbers + ", changed" * one.changed + ", worse" * one.worse)
    return "; ".join([*parts, "regressed" if found.regressed else "as good"])


def test_each_change_is_what_stands_below_it(golden):
    def gate(name):
        return None if name == "no gate" else float(name)

    golden("shifts.txt", answers(Path(__file__).with_name("shifts.txt"), gate, shifted))


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
