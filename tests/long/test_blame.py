"""Blame by real runs."""

import shutil

from daemon.campaign import expand, load_campaign
from daemon.model.verdicts import Outcome
from daemon.run import execute
from tests.analysis.blame import explain_and_save, write


def test_a_saved_failure_can_be_moved_elsewhere_and_fails_in_the_same_way(demo, tmp_path):
    (demo / "courier.mission.yaml").write_text(
        "mission: courier\nwaypoints:\n  - {id: hall, x: 1.0, y: 0.0}\n"
        "  - {id: kitchen, x: 0.2, y: -2.1}\n"
    )
    path = write(demo, **{"[doors, people]": "doors", "16 s": "26 s", ": {near: 1 m}": ""})
    saved = explain_and_save(path, repeat=1)
    story = saved.story
    assert story.minimal
    assert (story.objects, story.waypoints) == (("kitchen_door",), ("kitchen",))
    assert {str(o.element): o.word for o in story.layers}["doors_in_your_face"] == "pass"
    moved = shutil.move(saved.file.parent, tmp_path / "elsewhere")
    shutil.rmtree(demo)
    planned = expand(load_campaign(moved / "campaign.yaml"))
    run = planned.specs[-1]
    (verdict,) = execute(run, planned.scenes[0], trace_path=tmp_path / "again.mcap").verdicts
    assert verdict.outcome is Outcome.FAIL
    assert verdict.oracle == story.verdict.oracle
