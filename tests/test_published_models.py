"""The table of published models, made from what is in the repository."""

import json
import shutil

from tests.published_models import PAGE, Finding, findings, table


def test_what_is_published_is_found_and_tried(tmp_path, campaigns):
    demo = campaigns / "demo"
    for name in ("flat.fpm", "flat.variation"):
        shutil.copy(demo / name, tmp_path)
    (tmp_path / "torn.fpm").write_text("Floor plan: torn\nSpace hall:\n")
    frames = [{"pose": 0, "time": 10.0}, {"pose": 1.0, "time": 7.0}]
    (tmp_path / "door.json").write_text(json.dumps({"keyframes": frames}))
    (tmp_path / "task.yaml").write_text("waypoints:\n  - {id: a, x: 1.5, y: 2, yaw: 0.5, z: 0}\n")
    (tmp_path / "lost.yaml").write_text("image: nowhere.pgm\nresolution: 0.05\n")
    found = {finding.name: finding for finding in findings(tmp_path)}
    assert found["flat.fpm"] == Finding("plan", "flat.fpm", "yes", "yes", "yes")
    assert found["flat.variation"] == Finding("variation", "flat.variation", "yes", "yes", "yes")
    assert found["door.json"] == Finding("key frames", "door.json", "yes", "-", "yes")
    assert found["task.yaml"] == Finding("task", "task.yaml", "yes", "-", "yes")
    assert found["lost.yaml"].loads == "its image is not at hand"
    assert found["torn.fpm"].loads not in ("yes", "-", "")
    rows = table(list(found.values())).splitlines()
    assert len(rows) == 2 + len(found)
    assert all(row.count(" | ") == 4 for row in rows[2:])


def test_the_page_has_room_for_the_table():
    text = PAGE.read_text(encoding="utf-8")
    assert text.index("<!-- table -->") < text.index("<!-- end of table -->")
