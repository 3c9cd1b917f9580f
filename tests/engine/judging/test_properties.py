"""Laws of all oracles: verdicts never flip as a run goes on, limits act one way."""

import math
import re
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from daemon.judging.oracles import SignalSampler, judge, judge_so_far
from daemon.judging.oracles._predicate import evaluate_predicate
from daemon.model.spec import OracleText
from daemon.model.verdicts import Outcome
from daemon.trace import ContactRecord, ProgressRecord
from grammars.oracle import Signal, parse_oracle
from grammars.text.diagnostics import Where
from tests.engine.judging.traces import along, cut, make_trace, mission, track, verdict

LIMIT = 6.0
QUARTERS = st.integers(0, 4).map(lambda n: n / 4.0)


@st.composite
def traces(draw):
    """A complete run of up to 5 s at 4 Hz with jumpy errors, contacts and progress."""
    count = draw(st.integers(2, 20))
    of_samples = st.binary(min_size=count, max_size=count)  # drawn at once, which costs little
    speeds, errors = (np.frombuffer(draw(of_samples), np.uint8) % 5 / 4.0 for _ in range(2))
    speeds[1] = max(speeds[1], 0.25)  # a robot that never moves makes its trace invalid
    time = np.arange(count) / 4.0
    motion = along(time, vx=speeds, x=np.cumsum(speeds) / 4.0)
    known = draw(st.integers(0, 3))
    estimate = track(time[known:], motion.x[known:], errors[known:], sigma=0.3)
    hits = draw(st.lists(st.integers(0, count - 1), max_size=2))
    contacts = tuple(
        ContactRecord(float(time[i]), "robot", "wall", (0.0, 0.0), (1.0, 0.0), 0.01) for i in hits
    )
    passed = sorted(draw(st.lists(st.integers(0, count - 1), max_size=3)))
    progress = tuple(ProgressRecord(float(time[i]), n, n, "active") for n, i in enumerate(passed))
    points = draw(st.lists(QUARTERS, min_size=1, max_size=3))
    return make_trace(
        motion,
        estimate=estimate,
        contacts=contacts,
        progress=progress,
        goal=mission(*((4.0 * x, 0.0) for x in points)),
        limit=LIMIT,
    )


PREDICATES = (
    "loc.error <= {q} m",
    "loc.error < {q} m",
    "not contact",
    "speed <= {q} m/s and loc.error <= 0.5 m",
    "contact or loc.error.y > {q} m",
    "mission.reached >= 1",
    "loc.inside_2sigma",
)
TEMPORAL = (
    *("always({p})", "never({p})", "eventually({p})", "always within 2 s ({p})"),
    *("eventually within 2 s ({p})", "always({p}) until (mission.reached >= 1)"),
    *("never({p}) until within 2 s (speed > {q} m/s)", "whenever {p} then contact within 1 s"),
    "whenever speed > {q} m/s then {p} within 0.5 s",
)
FORMS = (
    *TEMPORAL,
    *("fraction({p}) >= 60 %", "fraction({p}) < 30 %"),
    *("time({p}) <= 1 s", "time({p}) > 1 s", "longest({p}) <= 0.5 s", "longest({p}) >= 1 s"),
    *("count({p}) <= 1", "count({p}) == 1", "count({p}) != 0", "max(loc.error) <= {q} m"),
    *("min(clearance) >= {q} m", "mean(speed) <= {q} m/s", "final(path.length) >= {q} m"),
    *("p95(loc.error) <= {q} m", "max(elapsed) <= 3 s", "reached(mission, 0.3 m)"),
)
GUARDS = ("speed > 0.3 m/s", "not contact", "mission.leg == 1", "loc.error <= 0.5 m")
LEGS = ("", "", " on leg 1", " on leg w1")


@st.composite
def oracles(draw, forms=FORMS):
    q = draw(QUARTERS)
    form = draw(st.sampled_from(forms))
    predicate = draw(st.sampled_from(PREDICATES))
    leg = "" if form.startswith("reached") else draw(st.sampled_from(LEGS))
    guard = draw(st.sampled_from(["", *(f" when {guard}" for guard in GUARDS)]))
    return form.format(p=predicate.format(q=q), q=q) + leg + guard


def written(*forms, least=4):
    """Oracles of these forms, to judge one trace by."""
    texts = st.lists(oracles(forms or FORMS), min_size=least, max_size=4)
    return texts.map(lambda texts: tuple(OracleText(str(i), t) for i, t in enumerate(texts)))


def bounds(found):
    return (
        -math.inf if found.lower is None else found.lower,
        math.inf if found.upper is None else found.upper,
    )


@pytest.mark.parametrize("every", range(4))
@given(data=st.data())
def test_a_run_that_goes_on_is_judged_by_what_cannot_change_any_more(every, data):
    """Nothing is claimed that the whole run denies, no failure is taken back."""
    whole, texts = data.draw(traces()), data.draw(written(*FORMS[every::4]))
    early = cut(whole, data.draw(st.integers(0, len(whole.ground_truth.time) - 1)) / 4.0)
    late = judge(whole, texts)
    for prefix, end in zip(judge(early, texts), late, strict=True):
        if prefix.outcome in (Outcome.PASS, Outcome.FAIL):
            assert end.outcome is prefix.outcome
        if end.outcome is not Outcome.INCONCLUSIVE:
            low, high = bounds(prefix)
            assert low - 1e-9 <= bounds(end)[0] <= bounds(end)[1] <= high + 1e-9
    for now, end in zip(judge_so_far(early, texts), late, strict=True):
        if now.outcome is Outcome.FAIL:
            assert end.outcome in (Outcome.FAIL, Outcome.ERROR)  # an error if it never moves
    # What it would be judged if it ended now, but for failures that may be mended.
    for now, end in zip(judge_so_far(cut(whole, whole.valid_until), texts), late, strict=True):
        mended = replace(end, outcome=Outcome.INCONCLUSIVE, upper=None)
        assert now in (end, mended) if end.outcome is Outcome.FAIL else now == end


@given(traces(), written())
def test_a_run_that_is_over_is_decided_unless_there_was_nothing_to_judge(whole, texts):
    found = judge(whole, texts)
    for one in found:
        if one.outcome is Outcome.INCONCLUSIVE:
            assert one.evidence.value is None
            assert one.evidence.note
        else:
            assert one.outcome in (Outcome.PASS, Outcome.FAIL)
            assert one.lower == one.upper
    assert judge(whole, texts) == found == judge_so_far(whole, texts)
    assert found == tuple(judge(whole, (text,))[0] for text in texts)


@given(traces(), oracles(("whenever {p} then loc.error <= {q} m within 1 s",)), st.booleans())
def test_an_answer_comes_in_time_after_each_occasion(trace, text, whole):
    """The plain definition: of each occasion the best margin in its time, of all the worst."""
    trace = trace if whole else cut(trace, 1.5)
    occasion, rest = text.removeprefix("whenever ").split(" then ")
    guard = rest.partition(" when ")[2] or "elapsed >= 0 s"
    holds, allowed = (flags(trace, one) for one in (occasion, guard))
    sampler = SignalSampler(trace)
    if " on leg " in rest:
        on_leg = sampler.current == 0
        gone = ~on_leg & np.logical_or.accumulate(on_leg)
        allowed &= on_leg & ~np.logical_or.accumulate(gone)
    error, time = sampler.sample(Signal("loc.error")).values, sampler.time_base.time
    limit = float(re.search(r"loc.error <= (\S+) m within", rest)[1])
    best = []
    for i in range(len(time)):
        if holds[i] and not (i and holds[i - 1]) and allowed[i]:
            near = [limit - e for e, t in zip(error, time, strict=True)
                    if time[i] <= t <= time[i] + 1.0 and not math.isnan(e)]  # fmt: skip
            if max(near, default=-1.0) >= 0.0 or (near and time[i] + 1.0 <= time[-1]):
                best.append(max(near))
    judged = verdict(trace, text)
    if whole:
        assert judged.margin == (min(best) if best else None)
    elif judged.outcome is Outcome.FAIL:
        assert min(best) < 0.0


def flags(trace, predicate):
    """Return where a predicate holds, sample by sample."""
    written = parse_oracle("it", f"never({predicate})", Where("o.yaml", 1))
    return evaluate_predicate(written.judgement.predicate, SignalSampler(trace)).margin >= 0.0


@given(traces(), written(), st.integers(1, 4000), st.booleans())
def test_shifting_time_changes_nothing(trace, texts, quarters, whole):
    judged = trace if whole else cut(trace, 1.0)
    for here, there in zip(
        judge(judged, texts), judge(shifted(judged, quarters / 4.0), texts), strict=True
    ):
        assert there.outcome is here.outcome
        assert bounds(there) == pytest.approx(bounds(here), abs=1e-9)
        assert there.evidence.object == here.evidence.object
        if here.evidence.time is not None:
            assert there.evidence.time == here.evidence.time + quarters / 4.0


def shifted(trace, by):
    """Return ``trace`` as if the simulation had begun ``by`` seconds later."""
    tracks = ("ground_truth", "odometry", "command", "estimate", "cloud", "joints")
    moved = {name: replace(t := getattr(trace, name), time=t.time + by) for name in tracks}
    for name in ("contacts", "progress"):
        moved[name] = tuple(replace(r, time=r.time + by) for r in getattr(trace, name))
    return replace(trace, valid_until=trace.valid_until + by, **moved)


@pytest.mark.parametrize("whole", [True, False])
@given(data=st.data())
def test_a_stricter_guard_never_turns_inconclusive_into_fail(whole, data):
    trace = data.draw(traces())
    # While a run goes on, a guard changes what a share is a share of; only what holds at all
    # samples or at one can be compared then.
    text = data.draw(oracles(FORMS if whole else TEMPORAL))
    stricter = data.draw(st.sampled_from(GUARDS))
    judged = trace if whole else cut(trace, data.draw(QUARTERS))
    joined = f"{text} and ({stricter})" if " when " in text else f"{text} when {stricter}"
    if verdict(judged, text).outcome is Outcome.INCONCLUSIVE:
        assert verdict(judged, joined).outcome is Outcome.INCONCLUSIVE


LIMITED = (
    "always(loc.error <= {q} m)",
    "always(loc.error < {q} m)",
    "never(loc.error > {q} m)",
    "eventually(loc.error <= {q} m)",
    "always(loc.error <= {q} m) until (mission.reached >= 1)",
    "never(contact) until within {q} s (mission.reached >= 1)",
    "whenever contact then loc.error <= {q} m within 1 s",
    "always(loc.error <= {q} m) on leg 1",
    "max(loc.error) <= {q} m",
    "p95(loc.error) < {q} m",
    "time(contact) <= {q} s",
    "fraction(contact) <= {q}",
    "longest(contact) < {q} s",
    "count(contact) <= {q}",
    "time(loc.error > {q} m) <= 0.5 s",
    "reached(mission, {q} m)",
)
RANK = {Outcome.FAIL: 0, Outcome.INCONCLUSIVE: 1, Outcome.PASS: 2}


@given(
    traces(),
    st.sampled_from(LIMITED),
    st.tuples(st.floats(0.01, 2.0), st.floats(0.01, 2.0)),
    st.booleans(),
)
def test_a_wider_limit_never_judges_worse(trace, form, limits, whole):
    judged = trace if whole else cut(trace, 0.5)
    narrow, wide = (verdict(judged, form.format(q=f"{q:.6f}")) for q in sorted(limits))
    assert RANK[narrow.outcome] <= RANK[wide.outcome]


@given(traces())
def test_never_mirrors_always_and_eventually(trace):
    predicate = "loc.error <= 0.5 m and (speed < 0.7 m/s or contact)"
    never = verdict(trace, f"never({predicate})")
    always = verdict(trace, f"always(not ({predicate}))")
    eventually = verdict(trace, f"eventually({predicate})")
    assert bounds(never) == bounds(always)
    if never.outcome is not Outcome.INCONCLUSIVE:
        assert {never.outcome, eventually.outcome} == {Outcome.PASS, Outcome.FAIL}
