"""The searches of the page about safe regions are of the published experiment."""

import pytest

from campaigns.studies.safe_region import SPACES, SYSTEMS, WORST
from daemon.campaign import load_campaign
from daemon.search.methods import SearchMethod
from daemon.search.space import SearchSpace


@pytest.fixture(scope="module")
def campaign(campaigns):
    return load_campaign(campaigns / "ortega2024" / "safe_region.yaml")


def test_their_scenarios_are_those_of_the_published_experiment(campaign, campaigns):
    published = load_campaign(campaigns / "ortega2024" / "campaign.yaml")
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
