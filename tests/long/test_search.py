"""A search by a real daemon, from the campaign file to the found scenario."""

import json

import pytest

from daemon.campaign import expand, load_campaign
from tests.people.cli.outputs import declared
from tests.people.cli.real import call_here, short_demo

SEARCH = """
search:
  slow-motor:
    about: Nobody gets home within these 20 s.
    scenario: open-house
    minimise: reached
    over:
      pilot.max_speed: 0.3 .. 0.5
    budget: 3 runs
    method: halton
    confirm: 0 repeats
    then: []
"""


@pytest.fixture
def place(tmp_path, campaigns):
    folder = short_demo(tmp_path, campaigns)
    file = folder / "campaigns" / "demo" / "campaign.yaml"
    file.write_text(file.read_text() + SEARCH)
    return folder


def test_what_is_found_says_the_same_on_its_own(place):
    state, file = place / "state", "campaigns/demo/campaign.yaml"
    try:
        done = call_here("search", file, "--json", state=state, cwd=place)
        assert done.returncode == 1, done.stderr
        body = declared(done.stdout)
        search = body["search"]
        assert search["state"] == "finished"
        assert search["answer"]["explored"] == len(body["proposals"]) == 3
        found = load_campaign(place / body["found"])
        assert [run.digest for run in expand(found).specs] == [search["answer"]["first"]["digest"]]
        again = call_here("search", file, "--detach", state=state, cwd=place)
        assert (again.returncode, "exists already" in again.stderr) == (0, True)
        standing = call_here("status", "--json", state=state, cwd=place)
        assert [row["search"] for row in json.loads(standing.stdout)["campaigns"]] == ["finished"]
        name = search["campaign"].rpartition("-")[0]
        blamed = call_here("blame", f"{name}.0", state=state, cwd=place)
        assert blamed.returncode == 2
        assert "is a run of a search" in blamed.stderr, blamed.stderr
        hint = call_here("check", file, state=state, cwd=place)
        assert "1 search" in hint.stderr
    finally:
        call_here("daemon", "--stop", state=state, cwd=place)
