import json

from grammars.model.behaviour import Hold, Jump, KeyFrame, KeyFrames, Spring, Trigger
from templates.sdf import behaviour_by_joint, write_keyframes
from templates.world import BehaviourDraw
from tests.scene.templates.worlds import BEHAVIOURS, job, scene


def frames(path):
    return json.loads(path.read_text())["keyframes"]


def test_both_forms_say_the_same(tmp_path):
    write_keyframes(job(tmp_path, "errand", BehaviourDraw("", BEHAVIOURS)))
    now, era = (
        frames(tmp_path / "keyframes/slider.json"),
        frames(tmp_path / "keyframes/era/slider.json"),
    )
    assert now == [
        {"position": 0.25, "time": 0.0},
        {"position": 1.0, "time": 5.0},
        {"position": 0.0, "time": 9.5},
    ]
    assert [f["pose"] for f in era] == [f["position"] for f in now]
    assert [f["time"] for f in era] == [f["time"] for f in now]


def test_frames_stay_as_they_are_listed():
    # The plugin takes them off the head of the list, whatever their times.
    act = KeyFrames("slider.rail", (KeyFrame(4.0, 1.0), KeyFrame(0.0, 0.5)), Jump())
    found = behaviour_by_joint(scene(), (act,))["slider.rail"]
    assert isinstance(found, KeyFrames)
    listed = [(f.time, f.position) for f in found.frames]
    assert listed == [(0.0, 0.25), (4.0, 1.0), (0.0, 0.5)]


def test_a_first_frame_at_the_start_is_kept():
    act = KeyFrames("slider.rail", (KeyFrame(0.0, 0.5), KeyFrame(4.0, 1.0)), Jump())
    assert behaviour_by_joint(scene(), (act,))["slider.rail"] == act


def test_what_is_pulled_or_held_begins_where_it_starts(tmp_path):
    acts = (
        Trigger("entrance.hinge", 1.4, 0.0, 1.3, Spring(0.5, 0.0), begin=0.7),
        Hold("slider.rail", 0.5),
    )
    write_keyframes(job(tmp_path, "errand", BehaviourDraw("", acts)))
    assert frames(tmp_path / "keyframes/entrance.json") == [{"position": 0.7, "time": 0.0}]
    assert frames(tmp_path / "keyframes/era/entrance.json") == [{"pose": 0.7, "time": 0.0}]
    assert frames(tmp_path / "keyframes/slider.json") == [{"position": 0.5, "time": 0.0}]
    assert not (tmp_path / "keyframes/era/slider.json").exists()


def test_only_joints_that_can_move_do_something():
    found = behaviour_by_joint(scene(), (Hold("entrance.hinge", 1.0),))
    assert list(found) == ["entrance.hinge", "other.hinge", "slider.rail"]
