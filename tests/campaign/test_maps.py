"""The map of a campaign: drawn by a rule, or one of its own."""

import json
from dataclasses import replace

import numpy as np
import pytest

from daemon.campaign import load_campaign
from daemon.model.attachments import user_files_folder
from daemon.model.spec import MapSettings, RunSpec
from daemon.run_map import MapMissingError, run_map, stored_map
from grammars.model.grid import FREE, OCCUPIED, UNKNOWN
from grammars.model.map_files import write_map
from grammars.text import codec
from templates.occupancy import occupancy_grid
from tests.campaign.loaded import messages, runs

OWN = {"file": "own.yaml"}


@pytest.fixture
def bare(campaign, tmp_path, monkeypatch):
    """Write a campaign in the flat without doors, and a second scenario with other keys."""
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path / "cache"))
    slots = {"floorplan": "flat", "mission": "courier", "oracles": ["reached"]}

    def write(map=None, other=None):
        scenarios = {"calm": slots, "other": {"like": "calm"} | (other or {})}
        return campaign(map=map, limit="3 min", scenarios=scenarios)

    return write


@pytest.fixture
def scene(bare):
    return load_campaign(bare()).cells[0].scene


@pytest.fixture
def grid(scene):
    return occupancy_grid(scene, laser_height=0.2)


def write_own(grid, folder, cells=None, name="own", laser_height=0.2, **changes):
    """Write a map, with other cells or other keys."""
    changes |= {} if cells is None else {"cells": cells}
    write_map(replace(grid, **changes), folder / name, laser_height=laser_height)


def test_a_map_is_drawn_by_outline_unless_the_campaign_says_otherwise(bare):
    assert {run.map.rule for run in runs(bare())} == {"outline"}
    first, second = runs(bare({"rule": "touch"}, {"map": {"rule": "centre"}}))
    assert (first.map, second.map) == (MapSettings(rule="touch"), MapSettings(rule="centre"))
    assert first.digest != second.digest


def test_a_run_recorded_before_there_were_rules_is_drawn_by_touch(bare, scene):
    plain = codec.to_plain(runs(bare())[0])
    plain["map"] = {"resolution": 0.05, "doors": "none"}
    old = codec.from_json(RunSpec, json.dumps(plain))
    assert old.map == MapSettings(0.05, "none", "touch", "")
    expected = occupancy_grid(scene, laser_height=0.2, rule="touch")
    assert np.array_equal(run_map(old.map, scene, 0.2, {}).cells, expected.cells)


@pytest.mark.parametrize("doors", ["none", "initial"])
def test_a_change_of_a_map_leaves_that_of_the_next_run_alone(scene, doors):
    settings = MapSettings(doors=doors)
    first = run_map(settings, scene, 0.2, {})
    expected = first.cells.copy()
    first.cells[:] = OCCUPIED
    assert np.array_equal(run_map(settings, scene, 0.2, {}).cells, expected)


def test_a_map_of_ones_own_is_the_one_of_the_run(bare, demo, scene, grid):
    cells = grid.cells.copy()
    cells[5, 7] = OCCUPIED
    write_own(grid, demo, cells)
    first, second = runs(bare(other={"map": OWN}))
    assert (first.map.file, second.map.resolution) == ("", 0.05)
    assert second.files == (second.map.file,)
    given = run_map(second.map, scene, 0.2, {})
    assert np.array_equal(given.cells, cells)
    assert (given.x, given.y, given.resolution) == (grid.x, grid.y, grid.resolution)


def test_a_run_is_known_by_the_content_of_its_map_not_by_its_place(bare, demo, grid):
    (demo / "maps").mkdir()
    write_own(grid, demo)
    write_own(grid, demo, name="maps/other", laser_height=0.7)
    here = runs(bare(OWN))
    assert runs(bare({"file": "maps/other.yaml"})) == here
    write_own(grid, demo, x=grid.x + 0.05)
    assert {run.digest for run in runs(bare(OWN))}.isdisjoint(run.digest for run in here)


def test_a_map_that_is_gone_or_damaged_is_refused(bare, demo, grid):
    write_own(grid, demo)
    name = runs(bare(OWN))[0].map.file
    stored = user_files_folder() / name
    stored.chmod(0o600)
    stored.write_bytes(stored.read_bytes()[:-1])
    with pytest.raises(MapMissingError, match="is not the map .* any more: remove it"):
        stored_map(name)
    stored.unlink()
    with pytest.raises(MapMissingError, match="cannot be read.*load its campaign again"):
        stored_map(name)


def test_maps_that_do_not_fit_are_warned_of(bare, demo, grid, golden):
    """``map_warnings.txt``: what is said more than of the map that is drawn."""
    taken = grid.cells.copy()
    for x, y, value in ((0.2, -2.1, OCCUPIED), (0.6, 2.6, UNKNOWN), (0.0, 0.0, UNKNOWN)):
        at = int((y - grid.y) / 0.05), int((x - grid.x) / 0.05)
        assert taken[at] == FREE
        taken[at] = value
    usual, lines = set(messages(bare())), []
    for name, cells in (
        ("that of the building", grid.cells),
        ("start and waypoints are not free", taken),
        ("cells in between", np.where(grid.cells == FREE, np.int8(40), grid.cells)),
        ("nothing is occupied", np.full_like(grid.cells, FREE)),
    ):
        write_own(grid, demo, cells)
        lines += [f"--- {name}", *(one for one in messages(bare(OWN)) if one not in usual)]
    golden("map_warnings.txt", "\n".join(lines) + "\n")
