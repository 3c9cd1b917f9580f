"""Searches at the daemon: what is admitted of them, and which client runs them."""

import shutil
from dataclasses import replace

import pytest

from daemon.batch.errors import Refused, Unavailable
from daemon.batch.paths import StatePaths
from daemon.batch.server import _search_handlers
from daemon.batch.server._search_handlers import SearchClients, read_extension
from daemon.model.search import MOST_PROPOSALS, SearchSubmission
from daemon.model.submission import CellRun
from grammars.text import codec
from tests.make import make_extension, make_search


@pytest.fixture
def places(tmp_path):
    places = StatePaths(tmp_path / "state")
    places.make_folders()
    return places


@pytest.fixture
def clock(monkeypatch):
    """Seconds of the clock by which clients are silent."""
    now = [100.0]
    monkeypatch.setattr(_search_handlers.time, "monotonic", lambda: now[0])
    return now


def test_a_silent_client_makes_room_for_another(clock):
    clients = SearchClients()
    assert clients.claim("s", "a")
    assert not clients.claim("s", "b")
    assert (clients.client("s"), clients.state("s")) == ("a", "running")
    with pytest.raises(Refused, match="a makes the proposals of s"):
        clients.require("s", "b")
    clock[0] += 14.0
    clients.require("s", "a")
    clock[0] += 16.0
    assert (clients.client("s"), clients.state("s")) == ("", "waiting")
    clients.require("s", "b")
    assert clients.client("s") == "b"


def test_after_a_restart_the_client_has_time_to_speak(clock):
    clients = SearchClients()
    assert clients.state("s") == "running"
    clock[0] += 16.0
    assert clients.state("s") == "waiting"


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
)
def test_what_no_campaign_file_asks_for_is_refused(changes):
    (wrong,) = changes
    with pytest.raises(ValueError, match=wrong):
        codec.from_json(SearchSubmission, codec.to_json(make_search("s", **changes)))


def test_runs_that_are_not_what_was_proposed_are_refused(places):
    good = make_extension("s", 4, 2)
    later = tuple(replace(one, position=one.position + 5 * one.number) for one in good.proposals)
    noisy = tuple(run._replace(repeat=1) for run in good.runs.runs)
    for wrong, words in (
        (replace(good, proposals=good.proposals[:1]), "2 runs for 1 proposals"),
        (replace(good, proposals=later), "proposals follow one after the other, not at 30"),
        (replace(good, runs=replace(good.runs, runs=noisy)), "repeat 1 was proposed as repeat 0"),
        (
            replace(good, runs=replace(good.runs, runs=(CellRun(9, 0, 0, 0),) * 2)),
            "a cell or a script that is not there",
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
