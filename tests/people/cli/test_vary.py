"""``scenario vary``: plans on disk, a table for people, an object for scripts."""

from pathlib import Path

import pytest

from grammars.floorplan import load_floorplan
from tests.people.cli.outputs import declared

PLAN = """Floor plan: cell
Defaults: walls: thickness: 0.1 m height: 2 m
var wide = 2 m
Space room: shape: Rectangle width=wide, length=3 m location: wrt: world of: this rotation: z: 0 deg
"""
VARIATION = (
    'import "cell.fpm"\nwide: uniform(1.5 .. 4)\n'
    "room: { location.rotation.z: uniform([-10 deg, 10]) }\nrequire room.area > 6 m^2\n"
)


@pytest.fixture
def folder(place):
    (place / "cell.fpm").write_text(PLAN)
    (place / "cell.variation").write_text(VARIATION)
    (place / "narrow.variation").write_text(f"{VARIATION}require wide > 5 m\n")
    (place / "mine").mkdir()
    (place / "mine" / "cell_0.fpm").write_text("mine")
    return place


def test_plans_are_written_and_told(folder, transcript):
    transcript("vary")
    files = sorted((folder / "out").iterdir())
    assert [f.name for f in files] == ["cell_10.fpm", "cell_7.fpm", "cell_8.fpm", "cell_9.fpm"]
    assert all(load_floorplan(f).name == "cell" for f in files)
    assert not (folder / "none").exists()
    assert len(list((folder / "flats").iterdir())) == 6
    assert load_floorplan(folder / "mine" / "cell_0.fpm").name == "cell_0"


def test_a_file_that_exists_is_kept(folder, scenario):
    scenario("vary", "cell.variation", "-n", "1", "-o", "mine")
    assert (folder / "mine" / "cell_0.fpm").read_text() == "mine"


def test_json_has_every_value_of_every_file(scenario, folder):
    how = ("-n", "2", "--json", "-o", "out", "--method", "lhs")
    body = declared(scenario("vary", "cell.variation", *how).out)
    assert body["schema"] == "scenario/vary/1"
    assert Path(body["plan"]).samefile("cell.fpm")
    for entry in body["variants"]:
        assert entry["outcome"] == "written"
        assert Path(entry["path"]).is_file()
        assert [(v["name"], v["unit"]) for v in entry["values"]] == [
            ("wide", "m"),
            ("room.location.rotation.z", "deg"),
        ]
