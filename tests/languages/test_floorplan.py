"""What a floor plan means: geometry of small plans worked out by hand."""

import inspect
import math
import sys

from grammars.floorplan import load_floorplan, parse_floorplan
from tests.languages.errors.goldens import renew
from tests.languages.plans import HERE


def number(value):
    return f"{round(value, 9) + 0.0:.10g}"


def ring(points):
    points = [f"({' '.join(map(number, point))})" for point in points]
    return " ".join(points if len(points) < 13 else [*points[:2], f"… {len(points)}"])


def place(frame):
    yaw = round(math.degrees(frame.yaw), 7) % 360
    return f"{number(frame.x)} {number(frame.y)} turned {number(yaw)}"


def meaning(path):
    """Return the geometry of a plan."""
    plan = load_floorplan(path)
    lines = [plan.name]
    for space in plan.spaces:
        lines.append(f"{space.name} at {place(space.frame)}, {space.where}: {ring(space.outline)}")
        lines += [
            f"    {wall.id} at {place(wall.frame)}, {number(wall.length)} long,"
            f" {wall.thickness} thick, {wall.height} high: {ring(wall.footprint)}"
            for wall in space.walls[:5]
        ]
    lines += [
        f"{each.id}, {each.kind} of {each.space or 'no space'} at {place(each.frame)},"
        f" {each.height} high: {ring(each.footprint)}"
        for each in plan.features
    ]
    for each in plan.openings:
        sizes = (each.width, each.depth, each.z_min, each.z_max, *each.centre)
        lines.append(f"{each.id}, {each.kind} in {' '.join(each.walls)}")
        lines.append(f"    width, depth, bottom, top, centre: {' '.join(map(number, sizes))}")
        lines += [f"    near: {ring(each.near)}", f"    far: {ring(each.far)}"]
    lines += map(str, plan.warnings)
    return "\n".join(lines) + "\n"


def test_plans_have_their_geometry(golden, tmp_path):
    golden("plans.txt", renew(HERE / "plans.txt", tmp_path / "files", meaning))


HEAD = "Floor plan: demo\nDefaults: walls: thickness: 0.2 m height: 2.4 m\n"
CIRCLE = "shape: Circle radius=1 m location: of: this"


def test_a_plan_is_loaded_from_its_file(tmp_path):
    path = tmp_path / "café.fpm"
    text = f"{HEAD}Space s: {CIRCLE} wrt: world\n"
    path.write_bytes(b"\xef\xbb\xbf" + text.replace("\n", "\r\n").encode())
    assert load_floorplan(path) == parse_floorplan(text)
    assert load_floorplan(str(path)).spaces[0].where.file == str(path)


def test_a_long_chain_of_rooms_is_placed_without_recursion():
    count, deepest = 300, sys.getrecursionlimit()
    rooms = "".join(f"Space s{k}: {CIRCLE} translation: x: 5 wrt: s{k + 1}\n" for k in range(count))
    sys.setrecursionlimit(len(inspect.stack(0)) + count)
    try:
        plan = parse_floorplan(f"{HEAD}{rooms}Space s{count}: {CIRCLE} wrt: world")
    finally:
        sys.setrecursionlimit(deepest)
    assert plan.spaces[0].frame.x == 5.0 * count
