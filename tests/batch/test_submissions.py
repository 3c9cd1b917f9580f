"""What the daemon admits: campaigns and searches in one form, whole, with all that they need."""

import shutil
from dataclasses import replace

import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from daemon.batch.errors import Refused, Unavailable
from daemon.batch.server import _workers
from daemon.batch.server._submissions import admit_submission, read_extension
from daemon.batch.server._workers import SearchClients
from daemon.campaign import expand, load_campaign
from daemon.model.assessments import AssessmentRules, RepeatPolicy
from daemon.model.messages import LARGEST_SUBMISSION
from daemon.model.search import MOST_PROPOSALS, SearchSubmission
from daemon.model.spec import SutReference
from daemon.model.submission import MOST_RUNS, CampaignOrigin, CellRun, Submission
from grammars.text import codec
from grammars.text.diagnostics import Severity
from tests.campaign.loaded import findings_of
from tests.make import make_extension, make_search, make_spec, make_submission, submission_of

DIGEST = "a" * 64


def refusal(submission, places):
    with pytest.raises(Refused) as problem:
        admit_submission(submission, places)
    assert list(places.scenes.iterdir()) == []
    return str(problem.value)


def test_a_bad_submission_is_refused_as_a_whole_with_all_reasons(places):
    orphan = replace(make_spec(1), scene="0" * 64)
    endless = replace(make_spec(2), limit=-1.0)
    foreign = replace(make_spec(3), engine="0")
    words = refusal(submission_of("c", make_spec(), make_spec(), orphan, endless, foreign), places)
    assert "S1/pilot/0 occurs twice" in words
    assert "S1/pilot: its scene 000000000000 is neither here nor in the submission" in words
    assert "S1/pilot: the limit must be" in words
    assert "S1/pilot: made for engine 0" in words


def test_all_that_is_wrong_is_said_up_to_ten_times(places):
    twice = submission_of("c", *[make_spec(i % 20) for i in range(40)])
    first, *_, last = refusal(twice, places).splitlines()
    assert first.startswith("S1/pilot/0 occurs twice")
    assert last == "and 10 more"


def test_a_campaign_of_too_many_runs_is_to_be_split(places):
    one = make_submission("c", 1)
    words = refusal(replace(one, runs=one.runs * (MOST_RUNS + 1)), places)
    assert f"has {MOST_RUNS + 1} runs" in words
    assert f"limit is {MOST_RUNS}: split its scenarios" in words


@pytest.mark.parametrize(
    ("changes", "words"),
    [
        ({"n": -1}, f"n must be from 1 to {MOST_RUNS} repeats, not -1"),
        ({"n": MOST_RUNS + 1}, f"n must be from 1 to {MOST_RUNS} repeats, not {MOST_RUNS + 1}"),
        ({"n": 5, "at_most": 4}, f"at_most must be from 5 (its n) to {MOST_RUNS} repeats, not 4"),
        ({"rate": 1.5}, "rate must be from 0 to 1, not 1.5"),
        ({"rate": float("nan")}, "rate must be from 0 to 1, not nan"),
    ],
)
def test_a_policy_that_no_repeats_can_follow_is_refused(places, changes, words):
    policy = replace(RepeatPolicy(2, "rate", 0.5, until_decided=True, at_most=16), **changes)
    submission = replace(make_submission("c"), declared=AssessmentRules(policy))
    assert refusal(submission, places) == f"the policy's {words}"


@pytest.mark.parametrize("name", ["../up", "a b", "", "x" * 200])
def test_a_campaign_id_must_be_one(places, name):
    assert "is not a campaign id" in refusal(make_submission(name), places)


def test_a_scenario_needs_a_name_that_a_file_can_have(places):
    long = submission_of("c", make_spec(scenario="x" * 300))
    assert "no usable file name" in refusal(long, places)
    admit_submission(submission_of("c", make_spec(scenario="../../etc/passwd")), places)


def test_repeats_in_reserve_are_held_to_the_same_rules(places):
    runs = [make_spec(repeat) for repeat in range(4)]
    words = refusal(submission_of("c", *runs[:2], reserve=runs[1:3]), places)
    assert "S1/pilot/1 occurs twice" in words
    admit_submission(submission_of("c", *runs[:2], reserve=runs[2:]), places)


def test_a_submission_without_its_files_is_refused(places):
    lacking = SutReference("m", "mine", {}, {"model": DIGEST})
    submission = submission_of("c", replace(make_spec(), sut=lacking))
    assert 'the file "model" of m was not sent' in refusal(submission, places)
    (places.files / DIGEST).touch()
    admit_submission(submission, places)


def test_a_submission_without_its_map_is_refused(places):
    spec = make_spec()
    spec = replace(spec, map=replace(spec.map, file="b" * 64))
    assert "S1/pilot: its map bbbbbbbbbbbb was not sent" in refusal(
        submission_of("c", spec), places
    )


@pytest.mark.parametrize("digest", ["../../etc/passwd", "0" * 63, "G" * 64, "0" * 64 + "\n"])
def test_what_is_no_digest_never_becomes_a_path(digest):
    sut = SutReference("mine", "learned", {}, {"a": digest})
    with pytest.raises(ValueError, match="pattern"):
        codec.from_json(SutReference, codec.to_json(sut))
    packed = codec.to_plain(make_submission("c"))
    packed["cells"][0]["map"]["file"] = digest
    with pytest.raises(ValueError, match="pattern"):
        codec.from_plain(Submission, packed)


# --- searches


def test_a_silent_client_makes_room_for_another(monkeypatch):
    now = [100.0]
    monkeypatch.setattr(_workers.time, "monotonic", lambda: now[0])
    clients = SearchClients()
    assert clients.state("s") == "running"  # after a restart its client has time to speak
    assert clients.claim("s", "a")
    assert not clients.claim("s", "b")
    assert (clients.client("s"), clients.state("s")) == ("a", "running")
    with pytest.raises(Refused, match="a makes the proposals of s"):
        clients.require("s", "b")
    now[0] += 14.0
    clients.require("s", "a")
    now[0] += 16.0
    assert (clients.client("s"), clients.state("s")) == ("", "waiting")
    clients.require("s", "b")
    assert clients.client("s") == "b"


@pytest.mark.parametrize(
    "changes",
    [
        {"name": "../doors"},
        {"name": "doors.1"},
        {"name": "d" * 41},
        {"parameters": ()},
        {"runs": 0},
        {"runs": MOST_PROPOSALS + 1},
        {"seconds": -1.0},
        {"window": 0},
        {"window": 10**9},
        {"confirm": 10**9},
        {"failures": 0},
        {"seed": -1},
        {"method": "m" * 1000},
    ],
    ids=str,
)
def test_what_no_campaign_file_asks_for_is_refused(changes):
    (wrong,) = changes
    with pytest.raises(ValueError, match=wrong):
        codec.from_json(SearchSubmission, codec.to_json(make_search("s", **changes)))


def test_runs_that_are_not_what_was_proposed_are_refused(places):
    good = make_extension("s", 4, 2)
    later = tuple(replace(one, position=one.position + 5 * one.number) for one in good.proposals)
    noisy = tuple(run._replace(repeat=1) for run in good.runs.runs)
    strange = (CellRun(9, 0, 0, 0),) * 2
    for wrong, words in (
        (replace(good, proposals=good.proposals[:1]), "2 runs for 1 proposals"),
        (replace(good, proposals=later), "the position 30 of a proposal does not follow"),
        (replace(good, runs=replace(good.runs, runs=noisy)), "repeat 1 was proposed as repeat 0"),
        (
            replace(good, runs=replace(good.runs, runs=strange)),
            "refers to a missing cell or script",
        ),
    ):
        with pytest.raises(Refused, match=words):
            read_extension(codec.to_json(wrong), places)
    assert list(places.incoming.iterdir()) == []


def test_runs_that_find_no_room_are_asked_for_again(places):
    shutil.rmtree(places.scenes)
    places.scenes.touch()  # as good as a disk that takes nothing more
    with pytest.raises(Unavailable, match="cannot be stored"):
        read_extension(codec.to_json(make_extension("s", 0, 1)), places)


# --- one form, in which what runs share is there once


@pytest.fixture(scope="module")
def submission(campaigns):
    """Systems under test of several kinds, doors that differ from repeat to repeat."""
    return expand(load_campaign(campaigns / "demo" / "campaign.yaml"))


def test_on_the_bus_nothing_of_it_is_lost(submission):
    spare = replace(submission, runs=submission.runs[:1], reserve=submission.runs[1:])
    for one in (submission, spare):
        assert codec.from_json(Submission, codec.to_json(one)) == one


def test_from_another_commit_it_is_the_same_submission(submission):
    there = replace(submission, origin=CampaignOrigin("c.yaml", "0" * 64, 3, "f" * 40, "main"))
    assert there.digest == submission.digest
    assert replace(there, about="another").digest != submission.digest


def test_digests_are_those_of_runs_that_are_written_out(submission):
    odd = replace(submission.cells[0], scenario='S "1" ä', limit=1e-7)
    runs = (CellRun(0, 0, 3, 2**63), *submission.runs)
    for one in (submission, replace(submission, cells=(odd, *submission.cells[1:]), runs=runs)):
        assert one.digests == tuple(spec.digest for spec in one.specs)
        assert Submission.of("c", one.specs, ()).digests == one.digests
        assert len(set(one.digests)) == len(one.runs)


def test_cells_and_scripts_are_there_once(submission):
    names = {(spec.scenario, spec.sut.name) for spec in submission.specs}
    assert len(submission.cells) == len(names)
    scripts = [codec.digest(list(script)) for script in submission.scripts]
    assert len(set(scripts)) == len(scripts)
    assert {run.script for run in submission.runs} == set(range(len(scripts)))


def test_a_hundred_thousand_runs_fit_into_one_submission(submission):
    shared = len(codec.to_json(replace(submission, runs=())))
    per_run = (len(codec.to_json(submission)) - shared) / len(submission.runs)
    assert shared + 100_000 * (per_run + len("99999")) < LARGEST_SUBMISSION


def test_the_ledger_gives_back_what_was_submitted(submission, ledger):
    ledger.book.submit(submission, 1.0)
    name, specs = submission.campaign, submission.specs
    leased = {lease.run: lease.spec for lease in ledger.lease(1000)}
    assert leased == {f"{name}.{i}": spec for i, spec in enumerate(specs)}
    assert ledger.reader.run(f"{name}.3").spec == specs[3]


SYSTEMS = st.sampled_from(["pilot", "idle", {"pilot": {"max_speed": 0.3}}])


@settings(
    max_examples=40, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture]
)
@given(
    suts=st.lists(SYSTEMS, min_size=1, max_size=3),
    names=st.lists(st.from_regex(r"[a-zA-Z@][a-z0-9._@ -]{0,70}", fullmatch=True), max_size=2),
    repeats=st.one_of(
        st.integers(-1, 3), st.just({"n": 2, "pass": "mean", "until": "decided", "at-most": 3})
    ),
    limit=st.sampled_from(["1 s", "0 s", "-2 s", "1e300 s", "2 min", "1e-9 s"]),
)
def test_the_daemon_takes_what_check_passes(campaign, places, suts, names, repeats, limit):
    scenarios = {name: {"like": "calm"} for name in names}
    file = campaign(matrix={"sut": suts}, scenarios=scenarios, repeats=repeats, limit=limit)
    if not any(one.severity is Severity.ERROR for one in findings_of(file)):
        admit_submission(expand(load_campaign(file)), places)
