"""A map of its own travels to a worker elsewhere, and to whoever executes a trace again."""

import hashlib
import shutil
from dataclasses import replace

import pytest
from mcap.reader import make_reader
from mcap_ros2.decoder import DecoderFactory

from daemon.analysis.verification import verify
from daemon.batch.paths import StatePaths
from daemon.campaign import expand, load_campaign
from daemon.model.attachments import user_files_folder
from daemon.run import execute
from grammars.floorplan import load_floorplan
from grammars.model.grid import OCCUPIED
from grammars.model.map_files import write_map
from grammars.scenery.composition import compile_scene
from templates.occupancy import occupancy_grid
from tests.batch.parts.test_transport import whole
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
def mapped(tmp_path, campaigns, monkeypatch):
    """A campaign whose map has a corner of its own, and that map."""
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path / "cache"))
    for path in (campaigns / "demo").iterdir():
        if path.suffix in (".fpm", ".yaml") and path.name != "campaign.yaml":
            shutil.copy(path, tmp_path)
    shutil.copy(campaigns / "robots" / "courier.yaml", tmp_path)
    (tmp_path / "campaign.yaml").write_text(CAMPAIGN)
    flat = compile_scene(load_floorplan(tmp_path / "flat.fpm"), [])
    grid = occupancy_grid(flat, laser_height=0.2)
    cells = grid.cells.copy()
    cells[:3, :3] = OCCUPIED
    grid = replace(grid, cells=cells)
    write_map(grid, tmp_path / "own", laser_height=0.2)
    return expand(load_campaign(tmp_path / "campaign.yaml")), grid


def recorded_map(trace):
    with trace.open("rb") as file:
        reader = make_reader(file, decoder_factories=[DecoderFactory()])
        (found,) = [message for *_, message in reader.iter_decoded_messages(["/map"])]
    return found.info.origin.position.x, list(found.data)


def test_a_worker_elsewhere_gives_the_map_to_its_runs(mapped, tmp_path, monkeypatch):
    submission, grid = mapped
    (spec,), (scene,) = submission.specs, submission.scenes
    here = execute(spec, scene, trace_path=tmp_path / "here.mcap")
    with daemon_at(tmp_path / "state") as daemon, daemon.client() as client:
        client.submit(submission)
        assert (daemon.state / "files" / spec.map.file).is_file()
        # The worker has another user's cache: what it needs it has from the daemon.
        monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path / "other"))
        options = ("--state", str(tmp_path / "elsewhere"))
        with worker_for(daemon, 1, *options, executor="daemon.run:execute"):
            eventually(lambda: finished(client, 1), 240.0)
        trace = whole(client, f"{submission.campaign}.0")
        assert recorded_map(trace) == (grid.x, grid.cells.ravel().tolist())
        assert hashlib.sha256(trace.read_bytes()).hexdigest() == here.trace.sha256
        # Executed again by its trace alone: the daemon has the map that this user lacks.
        assert not user_files_folder().exists()
        again = verify(trace, 1, places=StatePaths(daemon.state))
        assert (again.same_bytes, again.all_executed) == (1, True)
    nowhere = verify(trace, 1, places=StatePaths(tmp_path / "nowhere"))
    assert not nowhere.all_executed
    assert "the map" in nowhere.executions[0].problem
    assert "cannot be read" in nowhere.executions[0].problem
