"""The page about safe regions: its searches, its tables, its figure, and where they go."""

import json
import re
from dataclasses import replace
from pathlib import Path
from xml.etree import ElementTree

import pytest
from pydantic import TypeAdapter

from daemon.campaign import load_campaign
from daemon.model.proposals import Proposal
from daemon.model.search_answer import (
    Confirmation,
    NearestFailure,
    SearchAnswer,
    SearchRow,
)
from daemon.model.spec import LeadingMargin
from daemon.model.status import RunRow
from daemon.model.trials import Trial
from daemon.model.verdicts import Evidence, Outcome, Verdict
from daemon.search.answers.sentences import headline
from daemon.search.methods import SearchMethod
from daemon.search.space import SearchSpace
from tests.make import run_result, run_row
from tests.safe_region import (
    DONE,
    PAGE,
    SPACES,
    SYSTEMS,
    WORST,
    RecordedSearch,
    cost_table,
    does_well,
    draw_regions,
    nearest_table,
    page_tables,
    paired_table,
    read_searches,
    region_table,
)

CAMPAIGNS = Path(__file__).parents[1] / "campaigns" / "ortega2024"


@pytest.fixture(scope="module")
def campaign():
    return load_campaign(CAMPAIGNS / "safe_region.yaml")


def verdict(oracle, passes):
    outcome = Outcome.PASS if passes else Outcome.FAIL
    return Verdict(oracle, oracle, outcome, None, None, "", Evidence(None, None, None, "", ""))


def run(number, values, margin, done=True):
    """One run of a search that fills the space; the one of number 0 is the scenario as written."""
    proposal = Proposal(number, number, 0, "explore", "halton", False, values)
    result = run_result(
        verdict("no-contact", margin >= 0.0), verdict("no-collision", True),
        verdict("visited", done), outcome=Outcome.PASS, simulated=1800.0, cpu=2.0,
        leads=(LeadingMargin("no-contact", margin, "m", "door_17.leaf", "c022-3"),),
    )  # fmt: skip
    return run_row(f"s.{number}", result=result, proposal=proposal)


def recorded(campaign, name, rows):
    task = next(search for search in campaign.searches if search.name == name)
    return RecordedSearch(SearchRow(f"c-{name}", f"c-{name}", 0.0, task, "finished"), rows)


@pytest.fixture(scope="module")
def searches(campaign):
    """Three drawn points: a2s touches at one, fro-omni at none and is stuck at two of them."""
    points = ((1.3, 0.5), (0.7, 0.1), (0.8, 2.0), (1.5, 1.0))
    margins = (0.06, -0.01, 0.02, 0.1)
    a2s = tuple(run(n, p, m) for n, (p, m) in enumerate(zip(points, margins, strict=True)))
    omni = tuple(run(n, p, 0.05, n not in (1, 2)) for n, p in enumerate(points))
    return {
        "door-17-a2s": recorded(campaign, "door-17-a2s", a2s),
        "door-17-fro-omni": recorded(campaign, "door-17-fro-omni", omni),
    }


def columns(line):
    return [column.strip() for column in line.split("|")[1:-1]]


def test_its_scenarios_are_those_of_the_published_experiment(campaign):
    published = load_campaign(CAMPAIGNS / "campaign.yaml")
    for name in ("S2", "S3.2", "S3.3"):
        mine, theirs = (
            next(c for c in each.cells if c.name == name) for each in (campaign, published)
        )
        assert mine.scene.digest == theirs.scene.digest
        assert (mine.mission, mine.robot, mine.map) == (theirs.mission, theirs.robot, theirs.map)
        assert set(mine.behaviours) == set(theirs.behaviours)
        suts = {sut.name: sut for sut in theirs.suts}
        assert all(suts[sut.name] == sut for sut in mine.suts)


def test_both_systems_run_the_same_points(campaign):
    tasks = {task.name: task for task in campaign.searches}
    assert set(tasks) == {f"{space}-{sut}" for space in SPACES for sut in SYSTEMS} | {WORST}
    for space in SPACES:
        pair = [tasks[f"{space}-{system}"] for system in SYSTEMS]
        assert [task.sut for task in pair] == list(SYSTEMS)
        drawn = []
        for task in pair:
            method = SearchMethod(task, SearchSpace(task))
            drawn.append([method.propose() for _ in range(20)])
        assert drawn[0] == drawn[1]


def test_shares_are_of_drawn_runs_alone(searches):
    guided = run(9, (0.9, 0.9), -0.5)
    guided = replace(guided, proposal=replace(guided.proposal, guided=True))
    search = searches["door-17-a2s"]
    more = searches | {"door-17-a2s": replace(search, rows=(*search.rows, guided))}
    _, _, first, second = region_table(more)
    assert columns(first) == [
        "door 17 (S3.2), a2s", "3", "2 of 3 (9 to 99 %)", "3 of 3 (29 to 100 %)",
        "3 of 3 (29 to 100 %)", "2 of 3 (9 to 99 %)",
    ]  # fmt: skip
    assert columns(second)[2:] == [
        "3 of 3 (29 to 100 %)", "3 of 3 (29 to 100 %)", "1 of 3 (1 to 91 %)", "1 of 3 (1 to 91 %)",
    ]  # fmt: skip


def test_points_of_both_systems_are_compared_one_by_one(searches):
    _, _, safe, done = paired_table(searches)
    assert columns(safe)[2:] == ["3", "2", "0", "1", "0", "1"]
    assert columns(done)[2:] == ["3", "1", "1", "0", "1", "1"]


def test_what_has_no_verdict_does_neither_well_nor_badly():
    row = run(1, (1.0, 1.0), 0.1)
    odd = replace(row.verdicts[2], outcome=Outcome.INCONCLUSIVE)
    result = replace(row.result, verdicts=(*row.verdicts[:2], odd))
    with pytest.raises(ValueError, match=r"s\.1 has no verdict"):
        does_well(replace(row, result=result), DONE)


def test_the_nearest_failure_and_the_cost_are_told(searches):
    search = searches["door-17-a2s"]
    proposal = Proposal(1, 1, 0, "nearest", "nearest", True, (0.7, 0.1))
    failure = Trial(proposal, "s.1", outcome=Outcome.FAIL)
    nearest = NearestFailure(failure, None, 30, False, Confirmation(2, 5, 0.05, 0.85))
    answer = SearchAnswer("budget", 4, 4, 0, 1, 0, 0, 3, 1, nearest=nearest)
    told = {
        "door-17-a2s": replace(
            search, row=replace(search.row, answer=answer), seconds=(90.0, 120.0)
        )
    }
    assert columns(list(nearest_table(told))[-1]) == [
        "door-17-a2s", headline(told["door-17-a2s"].row),
        "30, all there were", "2 of 5 (5 to 85 %)",
    ]  # fmt: skip
    assert columns(list(cost_table(told))[-1]) == [
        "door-17-a2s", "halton", "4", "1", "1 of 3", "4", "8", "2.0", "2.0", "1.5, 2.0",
    ]  # fmt: skip


def test_the_figure_stands_alone(searches):
    drawn = draw_regions(searches)
    ElementTree.fromstring(drawn)
    assert "var(" not in drawn
    assert all(f"{system}: door 17 (S3.2)" in drawn for system in SYSTEMS)


def test_searches_are_read_as_the_command_writes_them(searches, tmp_path):
    def as_json(kind, value):
        return json.loads(TypeAdapter(kind).dump_json(value))

    for name, search in searches.items():
        written = {"search": as_json(SearchRow, search.row),
                   "proposals": as_json(tuple[RunRow, ...], search.rows)}  # fmt: skip
        (tmp_path / f"{name}.json").write_text(json.dumps(written))
    (tmp_path / "door-17-a2s.seconds").write_text("90.5 120\n")
    found = read_searches(tmp_path)
    assert found["door-17-a2s"] == replace(searches["door-17-a2s"], seconds=(90.5, 120.0))
    assert found["door-17-fro-omni"] == searches["door-17-fro-omni"]


def test_every_marker_of_the_page_has_a_table(searches):
    page = PAGE.read_text("utf-8")
    names = re.findall(r"<!-- table ([a-z-]+)", page)
    assert set(names) <= set(page_tables(searches))
    assert len(names) == len(set(names)) == page.count("<!-- end of table -->")
