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


@pytest.fixture
def file(tmp_path):
    (tmp_path / "cell.fpm").write_text(PLAN)
    path = tmp_path / "cell.variation"
    path.write_text(
        'import "cell.fpm"\nwide: uniform(1.5 .. 4)\n'
        "room: { location.rotation.z: uniform([-10 deg, 10]) }\nrequire room.area > 6 m^2\n"
    )
    return path


def test_it_writes_plans_and_shows_what_was_drawn(scenario, file, tmp_path):
    said = scenario("vary", str(file), "-n", "4", "--seed", "7", "--out", str(tmp_path / "out"))
    assert said.code == 0
    files = sorted((tmp_path / "out").iterdir())
    assert [f.name for f in files] == ["cell_10.fpm", "cell_7.fpm", "cell_8.fpm", "cell_9.fpm"]
    assert all(load_floorplan(f).name == "cell" for f in files)
    lines = [line.split() for line in said.out.splitlines()]
    assert ["a", "wide", "[m]"] in lines
    assert ["b", "room.location.rotation.z", "[deg]"] in lines
    drawn = {line[0]: line[1:] for line in lines if line and line[0].startswith("cell_")}
    assert list(drawn) == ["cell_7.fpm", "cell_8.fpm", "cell_9.fpm", "cell_10.fpm"]
    assert f"wide = {drawn['cell_8.fpm'][0]} m" in (tmp_path / "out" / "cell_8.fpm").read_text()
    assert {row[1] for row in drawn.values()} <= {"10", "−10"}
    assert any(row[2:3] == ["draw"] for row in drawn.values())
    assert "4 plans written to" in said.err


def test_json_has_every_value_of_every_file(scenario, file, tmp_path):
    said = scenario("vary", str(file), "-n", "2", "--json", "-o", str(tmp_path), "--method", "lhs")
    body = declared(said.out)
    assert body["schema"] == "scenario/vary/1"
    assert Path(body["plan"]).samefile(tmp_path / "cell.fpm")
    for entry in body["variants"]:
        assert Path(entry["path"]).is_file()
        assert entry["outcome"] == "written"
        assert [(v["name"], v["unit"]) for v in entry["values"]] == [
            ("wide", "m"),
            ("room.location.rotation.z", "deg"),
        ]


def test_files_that_exist_are_kept_and_said(scenario, file, tmp_path):
    (tmp_path / "cell_0.fpm").write_text("mine")
    said = scenario("vary", str(file), "-n", "1", "-o", str(tmp_path))
    assert "kept" in said.out
    assert "1 kept as they were: --overwrite replaces them" in said.err
    assert (tmp_path / "cell_0.fpm").read_text() == "mine"
    scenario("vary", str(file), "-n", "1", "-o", str(tmp_path), "--overwrite", "--suffix")
    assert load_floorplan(tmp_path / "cell_0.fpm").name == "cell_0"
    assert "1 there already" in (
        scenario("vary", str(file), "-n", "1", "-o", str(tmp_path), "--suffix").err
    )


def test_a_grid_has_as_many_plans_as_it_has_points(scenario, file, tmp_path):
    said = scenario("vary", str(file), "--method", "grid", "--levels", "4", "-o", str(tmp_path))
    assert said.code == 0
    assert "6 plans written" in said.err
    assert "more than 3" in scenario("vary", str(file), "--method", "grid", "-n", "3").err


def test_what_cannot_be_fulfilled_exits_with_2_and_writes_nothing(scenario, file, tmp_path):
    file.write_text(file.read_text() + "require wide > 5 m\n")
    said = scenario("vary", str(file), "--tries", "20", "-o", str(tmp_path / "out"))
    assert said.code == 2
    assert said.out == ""
    assert "rejected 20 times: require wide > 5 m" in said.err
    assert f"{file}:5:1: error" in said.err
    assert not (tmp_path / "out").exists()


def test_an_unsound_source_is_said_and_its_variants_are_checked(scenario, file, tmp_path):
    said = scenario("vary", str(file), "--check", "1.6", "--tries", "3", "-o", str(tmp_path))
    assert "warning: room cannot be reached with a radius of 1.6 m" in said.err
    assert said.code == 0
    assert scenario("vary", str(file), "--check", "0").code == 2


def test_seeds_that_run_over_are_wrong_usage(scenario, file):
    said = scenario("vary", str(file), "--seed", str(2**32 - 1), "-n", "2")
    assert said.code == 2
    assert "seeds are between 0 and 4294967295" in said.err


def test_the_example_that_ships_gives_sound_flats(scenario, campaigns, tmp_path):
    example = campaigns / "demo" / "flat.variation"
    said = scenario("vary", str(example), "-n", "6", "--check", "0.3", "-o", str(tmp_path))
    assert said.code == 0
    assert "6 plans written" in said.err
    assert "warning" not in said.err
