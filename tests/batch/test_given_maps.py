"""A map of one's own on its way: from the campaign file to a worker elsewhere, and back."""

import shutil
from dataclasses import replace
from pathlib import Path

import pytest
from mcap.reader import make_reader
from mcap_ros2.decoder import DecoderFactory

from daemon.analysis.verification import verify
from daemon.batch.errors import Refused
from daemon.batch.paths import StatePaths
from daemon.batch.server._submissions import admit_submission
from daemon.campaign import expand, load_campaign
from daemon.model.attachments import user_files_folder
from daemon.run import execute
from grammars.floorplan import load_floorplan
from grammars.model.grid import OCCUPIED
from grammars.model.map_files import write_map
from grammars.scenery.composition import compile_scene
from grammars.text import codec
from templates.occupancy import occupancy_grid
from tests.parts import daemon_at, eventually, finished, worker_for

CAMPAIGN = """\
campaign: given
seed: 7
repeats: 1
limit: 2 s
robot: courier
matrix: {sut: [pilot]}
oracles: navigation
map: {file: own.yaml}
scenarios:
  A: {floorplan: flat, mission: courier, oracles: [no-contact]}
"""


@pytest.fixture
def here(tmp_path, campaigns, monkeypatch):
    """A folder with a campaign whose map has a corner of its own."""
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path / "cache"))
    for path in (campaigns / "demo").iterdir():
        if path.suffix in (".fpm", ".yaml") and path.name != "campaign.yaml":
            shutil.copy(path, tmp_path)
    shutil.copy(campaigns / "robots" / "courier.yaml", tmp_path)
    (tmp_path / "campaign.yaml").write_text(CAMPAIGN)
    write_map(own_map(tmp_path), tmp_path / "own", laser_height=0.2)
    return tmp_path


def own_map(folder):
    grid = occupancy_grid(compile_scene(load_floorplan(folder / "flat.fpm"), []), laser_height=0.2)
    cells = grid.cells.copy()
    cells[:3, :3] = OCCUPIED
    return replace(grid, cells=cells)


def planned(folder):
    return expand(load_campaign(folder / "campaign.yaml"))


def recorded_map(trace):
    with trace.open("rb") as file:
        reader = make_reader(file, decoder_factories=[DecoderFactory()])
        (found,) = [message for *_, message in reader.iter_decoded_messages(["/map"])]
    return found.info.origin.position.x, list(found.data)


def test_a_worker_elsewhere_gives_the_map_to_its_runs(here, monkeypatch):
    submission = planned(here)
    (spec,) = submission.specs
    digest = spec.map.file
    with daemon_at(here / "state") as daemon, daemon.client() as client:
        client.submit(submission)
        assert (daemon.state / "files" / digest).is_file()
        # The worker has another user's cache: what it needs it has from the daemon.
        monkeypatch.setenv("XDG_CACHE_HOME", str(here / "other"))
        elsewhere = here / "elsewhere"
        options = ("--state", str(elsewhere))
        with worker_for(daemon, 1, *options, executor="daemon.run:execute"):
            eventually(lambda: finished(client, 1), 240.0)
        assert (next((elsewhere / "work").iterdir()) / "files" / digest).is_file()
        row = client.run(f"{submission.campaign}.0").row
        assert row.state == "done"
        trace = Path(row.trace)
        expected = own_map(here)
        assert recorded_map(trace) == (expected.x, expected.cells.ravel().tolist())
        # Executed again by its trace alone: the daemon has the map that this user lacks.
        assert not user_files_folder().exists()
        again = verify(trace, 1, places=StatePaths(daemon.state))
        assert (again.same_bytes, again.all_executed) == (1, True)


def test_the_same_campaign_here_leaves_the_same_trace(here):
    submission = planned(here)
    (spec,), (scene,) = submission.specs, submission.scenes
    results = [execute(spec, scene, trace_path=here / f"{k}.mcap") for k in range(2)]
    assert len({result.trace.sha256 for result in results}) == 1
    assert recorded_map(here / "0.mcap")[1] == own_map(here).cells.ravel().tolist()


def test_a_trace_whose_map_is_nowhere_says_so(here):
    submission = planned(here)
    execute(submission.specs[0], submission.scenes[0], trace_path=here / "run.mcap")
    shutil.rmtree(user_files_folder())
    found = verify(here / "run.mcap", 1, places=StatePaths(here / "state"))
    assert not found.all_executed
    assert "the map" in found.executions[0].problem
    assert "cannot be read" in found.executions[0].problem


def test_a_submission_without_its_map_is_refused(here):
    places = StatePaths(here / "state")
    places.make_folders()
    with pytest.raises(Refused, match="A/pilot: its map .* was not sent along"):
        admit_submission(planned(here), places)


@pytest.mark.parametrize("file", ["../../etc/passwd", "0" * 63, "G" * 64, "0" * 64 + "\n"])
def test_what_is_no_digest_never_becomes_a_path(here, file):
    packed = codec.to_plain(planned(here))
    packed["cells"][0]["map"]["file"] = file
    kind = type(planned(here))
    with pytest.raises(ValueError, match="pattern"):
        codec.from_plain(kind, packed)
