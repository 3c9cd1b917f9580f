"""A search as a daemon has it: a task of three parameters, its runs, its answer."""

from dataclasses import replace

from daemon.model.search import OracleScale, Proposal, SearchParameter, SearchTask
from daemon.model.search_answer import (
    Confirmation,
    DistinctFailure,
    Influence,
    NearestFailure,
    SearchAnswer,
    SearchRow,
    ShrunkScenario,
)
from daemon.model.spec import LeadingMargin
from daemon.model.trials import read_trial
from daemon.model.verdicts import Evidence, Outcome, Verdict
from tests.make import run_result, run_row

SEARCH = "house-doors-in-time-0f1e2d3c"
MARGINS = (0.105, 0.104, 0.061, 0.105, -0.012, 0.02, -0.031, 0.104)
"""What the runs of points come to, in order."""

TASK = SearchTask(
    name="doors-in-time",
    scenario="busy-house",
    sut="pilot",
    minimise="keeps-clear",
    scales=(OracleScale("keeps-clear", 0.05, "m"),),
    parameters=(
        SearchParameter(
            "doors_moving.kitchen_opens", "behaviours", 0, "kitchen_opens", "s", 7.1, 8.9, 0.01,
            written=8.0,
        ),
        SearchParameter(
            "robot.laser.noise", "robot", 0, "laser.noise", "m", 0.01, 0.05, 0.001, log=True,
            written=0.01,
        ),
        SearchParameter(
            "doors_moving.leading", "behaviours", 0, "leading",
            choices=("bedroom_door", "kitchen_door"), written="bedroom_door",
        ),
    ),
    runs=60,
    seed=7,
    about="Doors a little early or late",
)  # fmt: skip


def make_proposals():
    """Finished runs of points with those margins."""
    return tuple(make_proposal_row(number, margin) for number, margin in enumerate(MARGINS))


def make_proposal_row(number, margin):
    """A finished run of the search."""
    values = (8.0 + 0.1 * number, 0.02, "kitchen_door" if number % 2 else "bedroom_door")
    outcome = Outcome.FAIL if margin < 0 else Outcome.PASS
    seen = Evidence(31.5, margin + 0.05, 0.05, "kitchen_door")
    text = "always(clearance >= 0.05 m)"
    return run_row(
        f"{SEARCH}.{number}", f"doors-in-time.{number}", "pilot",
        result=run_result(
            Verdict("keeps-clear", text, outcome, margin, margin, "m", seen),
            leads=(LeadingMargin("keeps-clear", margin, "m", "kitchen_door"),),
        ),
        digest=f"{number:064d}",
        trace=f"state/traces/{SEARCH}/doors-in-time.{number}.pilot.0.mcap",
        proposal=Proposal(number, number, 0, "explore", "halton", number >= 6, values),
    )  # fmt: skip


def make_answer():
    """An answer with a failure, its nearest one, a finding, and what the parameters do."""
    rows = make_proposals()
    best, first = read_trial(TASK, rows[6]), read_trial(TASK, rows[4])
    confirmed = Confirmation(5, 5, 0.478, 1.0)
    written = read_trial(TASK, rows[0])
    nearest = NearestFailure(first, written, 13, complete=True, confirmed=confirmed)
    return SearchAnswer(
        ended="budget",
        explored=len(rows),
        executed=len(rows) + 17,
        reused=3,
        failed=2,
        errors=0,
        inconclusive=0,
        space_filling=6,
        space_filling_failed=1,
        first=first,
        best=best,
        confirmed=confirmed,
        nearest=nearest,
        shrunk=ShrunkScenario(("minimal: kitchen_door (of 3 objects)",), minimal=True, runs=9),
        findings=(DistinctFailure("keeps-clear", "kitchen_door", "kitchen", 2, best),),
        influence=(
            Influence("robot.laser.noise", 0.08, 6),
            Influence("doors_moving.kitchen_opens", -0.93, 6),
            Influence("doors_moving.leading", 0.2, 6),
        ),
        sentences=(
            "keeps-clear fails in 5 of 5 repeats with kitchen_opens 8.4 s instead of 8 s",
            "2 of 8 runs fail, the first is run 4",
        ),
        found="campaign: house\n",
    )  # fmt: skip


def make_search(state="finished", **changes):
    """A search in the ledger; finished ones have an answer."""
    row = SearchRow(
        campaign=SEARCH,
        name="house",
        submitted_at=1_799_999_000.0,
        task=TASK,
        state=state,
        proposed=len(MARGINS),
        finished=len(MARGINS),
        answer=make_answer() if state == "finished" else None,
        file="campaign.yaml",
        client="lab-7" if state == "running" else "",
    )
    return replace(row, **changes)
