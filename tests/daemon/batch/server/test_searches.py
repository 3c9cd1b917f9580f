"""Searches at the daemon: what is admitted of them, and what clients see."""

import base64
import shutil
from dataclasses import replace

import pytest

from daemon.batch.errors import Refused, Unavailable
from daemon.batch.paths import StatePaths
from daemon.batch.server import read_extension, stage_search
from daemon.model.search import MOST_PROPOSALS, BundledFile
from daemon.model.search_answer import SearchProgress
from daemon.model.submission import CellRun
from daemon.model.verbs import EXTEND, PROGRESS
from grammars.text import codec
from tests.daemon.batch.harness import daemon_at
from tests.daemon.batch.samples import make_extension, make_search, make_submission


def refused(search, folder):
    """Why the files of a search are not taken; nothing of them is there afterwards."""
    places = StatePaths(folder)
    places.make_folders()
    with pytest.raises(Refused) as caught:
        stage_search(codec.to_json(search), places)
    assert list(places.searches.iterdir()) == []
    return str(caught.value)


@pytest.fixture
def places(tmp_path):
    places = StatePaths(tmp_path / "state")
    places.make_folders()
    return places


def kept(places):
    return [*places.searches.iterdir(), *places.incoming.iterdir()]


def test_the_files_of_a_search_come_back_as_they_were(tmp_path):
    image = "P5" * 2**18
    search = make_search("s", {"a/campaign.yaml": "campaign: test", "maps/flat.pgm": image})
    idle = "tests.daemon.search.fake_search:idle"
    with daemon_at(tmp_path / "state", searcher=idle) as daemon, daemon.client() as client:
        places = StatePaths(daemon.state)
        assert client.submit_search(search).known is False
        assert client.submit_search(search).known is True
        assert client.bundle("s") == search
        folder = places.search("s")
        assert (folder / "maps" / "flat.pgm").read_text() == image
        modes = {path.stat().st_mode & 0o777 for path in (folder, *folder.rglob("*"))}
        assert modes == {0o700, 0o600}
        assert kept(places) == [folder]
        with pytest.raises(Refused, match="taken by another campaign"):
            client.submit_search(replace(search, about="another"))
        assert kept(places) == [folder]
        assert client.ask(EXTEND, make_extension("s", 0, 3)).count == 3
        assert client.ask(EXTEND, make_extension("s", 1, 3, send_scenes=False)).count == 1
        assert [row.run.digest for row in client.proposals("s")] == [
            client.run(row.id).spec.digest for row in client.runs(campaign="s").rows
        ]
        assert [row.proposal.position for row in client.proposals("s", 2)] == [2, 3]
        assert client.campaigns(unfinished=True)[0].search == "running"
        with pytest.raises(Refused, match="goes on: cancel it first"):
            client.delete(("s",))
        client.ask(PROGRESS, SearchProgress("s", "explore", "no more", "failed"))
        (row,) = client.searches()
        assert (row.state, row.note) == ("failed", "no more")
        assert client.cancel("s") == 4
        client.delete(("s",))
        assert client.search_row("s") is None


@pytest.mark.parametrize(
    "path",
    [
        "/etc/passwd", "../up", "a/../../up", "a//b", "./a", "a/", "", ".", "..", "a\\b",
        "a\nb", "x" * 201, "a/..",
    ],
)  # fmt: skip
def test_a_file_that_leads_elsewhere_is_refused_with_all_others(tmp_path, path):
    search = make_search("s")
    bad = replace(search, files=(*search.files, BundledFile(path, "")))
    assert "no path of a file" in refused(bad, tmp_path)


def bundled(path, data=b"x"):
    return BundledFile(path, base64.b64encode(data).decode())


@pytest.mark.parametrize(
    ("files", "words"),
    [
        ((bundled("c.yaml"), bundled("c.yaml")), "c.yaml is twice"),
        ((bundled("c.yaml"), bundled("c.yaml/below")), "is a file and a folder"),
        ((bundled("other.yaml"),), "'c.yaml' is not among the files"),
        ((BundledFile("c.yaml", "!"),), "no base64"),
        ((bundled("c.yaml"), *(bundled(f"{n}", b"x" * 2**23) for n in range(5))), "32 MiB"),
    ],
)
def test_what_is_wrong_with_files_is_said(tmp_path, files, words):
    search = replace(make_search("s"), files=files, file="c.yaml")
    assert words in refused(search, tmp_path)


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
def test_what_no_campaign_file_asks_for_is_refused(tmp_path, changes):
    (wrong,) = changes
    assert wrong in refused(make_search("s", **changes), tmp_path)


def test_files_that_were_lost_come_with_the_same_search_again(places):
    payload = codec.to_json(make_search("s"))
    folder = places.search("s")
    for lose in (
        lambda: None,
        lambda: (folder / "campaign.yaml").unlink(),
        lambda: (folder / "layers" / "doors.scenery").write_text(""),
        lambda: shutil.rmtree(folder),
    ):
        staged = stage_search(payload, places)
        staged.place(places, same=folder.is_dir())
        staged.remove()
        lose()
    staged = stage_search(payload, places)
    staged.place(places, same=True)
    staged.remove()
    assert (folder / "campaign.yaml").read_text() == "campaign: test\n"
    assert (folder / "layers" / "doors.scenery").read_text() == "scenery doors"
    before = folder.stat().st_ino
    staged = stage_search(payload, places)
    staged.place(places, same=True)
    staged.remove()
    assert folder.stat().st_ino == before
    assert kept(places) == [folder]


def test_a_search_that_is_refused_leaves_nothing(places):
    search = make_search("s")
    bad = replace(search, files=(*search.files, BundledFile("../up", "")))
    for wrong in (bad, replace(search, campaign="../s"), replace(search, file="none")):
        with pytest.raises(Refused):
            stage_search(codec.to_json(wrong), places)
    assert kept(places) == []


def test_runs_that_are_not_what_was_proposed_are_refused(places):
    good = make_extension("s", 4, 2)
    later = tuple(replace(one, position=one.position + 5 * one.number) for one in good.proposals)
    noisy = tuple(run._replace(repeat=1) for run in good.runs.runs)
    for wrong, words in (
        (replace(good, campaign="t"), "the runs are of 's', not of 't'"),
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
    assert kept(places) == []


def test_a_plain_campaign_is_no_search(tmp_path):
    with daemon_at(tmp_path / "state") as daemon, daemon.client() as client:
        client.submit(make_submission("plain", 1))
        assert client.campaigns()[0].search == ""
        for ask in (
            lambda: client.proposals("plain"),
            lambda: client.bundle("plain"),
            lambda: client.ask(EXTEND, make_extension("plain", 1)),
            lambda: client.ask(PROGRESS, SearchProgress("plain", "explore")),
        ):
            with pytest.raises(Refused, match="no search"):
                ask()


def test_runs_that_find_no_room_are_asked_for_again(places):
    shutil.rmtree(places.scenes)
    places.scenes.touch()  # as good as a disk that takes nothing more
    with pytest.raises(Unavailable, match="cannot be stored"):
        read_extension(codec.to_json(make_extension("s", 0, 1)), places)
    assert kept(places) == []
