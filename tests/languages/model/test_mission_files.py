import math

import pytest

from grammars.model.geometry import Pose2
from grammars.model.mission_files import load_mission


def write(folder, text):
    path = folder / "file.yaml"
    path.write_text(text)
    return path


def test_a_mission_reads_task_files_of_navigation_stacks(tmp_path):
    text = "waypoints:\n  - {id: a, x: 1, y: 2, yaw: 0.5, z: 0}\n  - {x: 3.5, y: -1}\n"
    mission, _ = load_mission(write(tmp_path, text))
    assert mission.start == Pose2()
    assert [(w.id, w.x, w.y, w.yaw) for w in mission.waypoints] == [
        ("a", 1.0, 2.0, 0.5),
        ("waypoint-2", 3.5, -1.0, None),
    ]


def test_a_mission_takes_units_too(tmp_path):
    text = "start: {x: 50 cm, y: 0, yaw: 90 deg}\nwaypoints: [{x: 1 m, y: 2 m}]\n"
    mission, _ = load_mission(write(tmp_path, text))
    assert mission.start.x == pytest.approx(0.5)
    assert mission.start.yaw == pytest.approx(math.pi / 2)


def test_the_published_missions_load(reference_data):
    lengths = {
        path.name: len(load_mission(path)[0].waypoints)
        for path in sorted((reference_data / "missions").glob("*.yaml"))
    }
    assert lengths == {
        "left_long_corridor_task.yaml": 5,
        "task_1.yaml": 1,
        "task_2.yaml": 5,
        "task_3.yaml": 2,
        "task_4.yaml": 10,
    }
