"""A point of a search is the run that a campaign specifies with the point's values written in."""

from __future__ import annotations

import shutil
from pathlib import Path

import pytest

from daemon.campaign import expand, load_campaign
from daemon.model.search import Point
from daemon.model.spec import RunSpec
from daemon.search.composition import SearchCase, load_search_case
from grammars.text.diagnostics import InputError

DOORS = """\
parameter swing = 60 deg/s
parameter closes = 6 s
parameter opens = 14 s
group leading: bedroom_door

all leading moves to open at 0 s, to closed at closes, to open at opens, by servo at swing
living_room_door toggles between closed and open every 5 s with probability 0.5
"""
CAMPAIGN = """\
campaign: tiny
seed: 3
repeats: 3
limit: 3 min
robot: courier
oracles: navigation
matrix: {sut: [pilot, idle]}
defaults:
  floorplan: PLAN
  objects: doors
  mission: courier
  oracles: [keeps-clear, nearest]
  chance: CHANCE
scenarios:
"""
BUSY = "  busy: {behaviours: [doors_open, doors_moving]}\n"
OTHER = """\
  calm: {behaviours: doors_open}
compare: {patience: delay(busy vs calm on leg kitchen) <= 9 s}
"""
SEARCH = """\
search:
  s:
    scenario: busy
    sut: pilot
    minimise: keeps-clear
    method: halton
    over:
      doors_moving.closes: 4 .. 20 s
      doors_moving.opens: 5 .. 25 s
      doors_moving.swing: 48 .. 72 deg/s
      doors_moving.leading: [bedroom_door, kitchen_door]
"""
WRITTEN: Point = (6.0, 14.0, 60.0, "bedroom_door")


@pytest.fixture
def folder(tmp_path: Path, campaigns: Path) -> Path:
    """The layers of the demonstration, with doors whose times have names."""
    folder = Path(shutil.copytree(campaigns / "demo", tmp_path / "mine"))
    (folder / "doors_moving.scenery").write_text(DOORS)
    return folder


def case_in(folder: Path, *, chance: str = "per repeat", plan: str = "flat") -> SearchCase:
    path = folder / "tiny.yaml"
    head = CAMPAIGN.replace("CHANCE", chance).replace("PLAN", plan)
    path.write_text(head + BUSY + OTHER + SEARCH)
    return load_search_case(path, "s")


def by_hand(folder: Path, scenario: str, *, chance: str = "per repeat") -> list[RunSpec]:
    """Return the runs with pilot of a campaign with that scenario alone."""
    path = folder / "hand.yaml"
    head = CAMPAIGN.replace("CHANCE", chance).replace("PLAN", "flat")
    path.write_text(head + scenario)
    return [run for run in expand(load_campaign(path)).runs if run.sut.name == "pilot"]


@pytest.mark.parametrize("chance", ["per repeat", "per campaign"])
def test_a_point_is_the_run_with_its_values_written_beside_the_layer(
    chance: str, folder: Path
) -> None:
    case = case_in(folder, chance=chance)
    values = "{closes: 6.25 s, opens: 15 s, swing: 52.5 deg/s, leading: kitchen_door}"
    scenario = f"  s.7: {{behaviours: [doors_open, doors_moving: {values}]}}\n"
    wanted = by_hand(folder, scenario, chance=chance)
    point = (6.25, 15.0, 52.5, "kitchen_door")
    made = [case.candidate(point, 7, repeat) for repeat in range(3)]
    assert [one.spec.digest for one in made] == [run.digest for run in wanted]
    assert all(one.spec.scene == one.scene.digest for one in made)


def test_the_written_values_are_the_scenario_as_it_stands(folder: Path) -> None:
    case = case_in(folder)
    assert tuple(p.written for p in case.task.parameters) == WRITTEN
    scenario = "  s.0: {behaviours: [doors_open, doors_moving]}\n"
    wanted = by_hand(folder, scenario)
    assert [case.candidate(WRITTEN, 0, r).spec.digest for r in (0, 1, 2)] == [
        run.digest for run in wanted
    ]


def test_what_comparisons_measure_is_left_out(folder: Path) -> None:
    spec = case_in(folder).candidate(WRITTEN, 0).spec
    assert [oracle.name for oracle in spec.oracles] == ["keeps-clear", "nearest"]


def test_a_point_has_the_same_run_however_often_and_after_whatever(folder: Path) -> None:
    case = case_in(folder)
    first = case.candidate(WRITTEN, 0).spec.digest
    others = {
        case.candidate((4.0 + n / 10, 20.0, 60.0, "bedroom_door"), n).spec.digest for n in range(99)
    }
    assert len(others) == 99
    assert case.candidate(WRITTEN, 0).spec.digest == first


def test_a_point_that_makes_no_run_is_bad_input(folder: Path) -> None:
    case = case_in(folder)
    with pytest.raises(InputError, match="is not after"):
        case.candidate((15.0, 14.0, 60.0, "bedroom_door"), 1)
    assert case.candidate(WRITTEN, 2).spec.scenario == "s.2"


def test_a_point_can_be_taken_apart(folder: Path) -> None:
    case = case_in(folder)
    point = (6.25, 15.0, 52.5, "kitchen_door")
    taken = case.run_case(point, 7)
    candidate = case.candidate(point, 7)
    assert taken.spec == candidate.spec
    whole = (*taken.added, *taken.parts(taken.added))
    again = taken.candidate(whole, taken.spec.oracles[0])
    assert again.spec.behaviours == candidate.spec.behaviours
    assert any("closes 6.25 s" in element.name for element in taken.added)


def test_a_search_that_is_not_there_is_told_with_those_that_are(folder: Path) -> None:
    case_in(folder)
    with pytest.raises(InputError, match='did you mean "s"'):
        load_search_case(folder / "tiny.yaml", "ss")


def test_a_task_may_come_from_elsewhere(folder: Path) -> None:
    case = case_in(folder)
    other = load_search_case(folder / "tiny.yaml", "s", case.task)
    assert other.candidate(WRITTEN, 3).spec == case.candidate(WRITTEN, 3).spec
