"""Explaining pictures of the pages on languages.

Plans, doors and frames are compiled by the product itself, so a picture cannot disagree with it.
Each function of :data:`DIAGRAMS` returns the text of an SVG file of ``docs/pictures``.
"""

import html
import math
import tempfile
from pathlib import Path

from grammars.floorplan import parse_floorplan
from grammars.model.behaviour import start_positions
from grammars.model.geometry import Pose2
from grammars.model.robot_files import load_robot
from grammars.scenery import parse_scenery
from grammars.scenery.composition import compile_scene
from grammars.variation import parse_variation, sample
from templates import plan_shapes
from templates.plan_shapes import ShapeRole

ROOT = Path(__file__).parents[3]
CUT = 0.3
"""Height at which plans are cut [m]."""
INK, SOFT, WALL, BLUE, RED, GREEN = "#2b2f36", "#6a707a", "#3b4048", "#22638f", "#c8553d", "#1d7f58"
_FILLS = {
    ShapeRole.FLOOR: "#ffffff",
    ShapeRole.WALL: WALL,
    ShapeRole.SWING: "#e9a17866",
    ShapeRole.DOOR: RED,
    ShapeRole.POST: "#6d3023",
}
_STYLE = (
    "text{font:14px system-ui,sans-serif;fill:#2b2f36;stroke:none}"
    ".small{font-size:12px;fill:#4d535c}.strong{font-weight:700}"
)


class Sheet:
    """Drawing of ``width`` by ``height`` pixels with a part of the floor on it.

    ``scale`` is in pixels per metre; the origin of the map lies at ``origin`` on the page.
    """

    def __init__(self, width, height, title, scale=1.0, origin=(0.0, 0.0)):
        self._width, self._height, self._title = width, height, title
        self._scale, self.origin = scale, origin
        self._items = []

    def at(self, point):
        """Return a point of the map [m] on the page."""
        return (
            self.origin[0] + self._scale * point[0],
            self.origin[1] - self._scale * point[1],
        )

    def line(self, points, colour=INK, width=1.5, *, fill="none", dash="", tip=False, ends="M"):
        """Draw a line through points of the page; with ``ends="Z"`` close it."""
        path = " ".join(f"{x:.1f} {y:.1f}" for x, y in points)
        more = f' stroke-dasharray="{dash}"' if dash else ""
        more += f' marker-end="url(#tip-{colour[1:]})"' if tip else ""
        close = "Z" if ends == "Z" else ""
        self._items.append(
            f'<path d="M{path}{close}" fill="{fill}" stroke="{colour}"'
            f' stroke-width="{width}"{more}/>'
        )

    def area(self, points, fill, colour="none"):
        """Fill a ring of points of the page."""
        self.line(points, colour, 1.0, fill=fill, ends="Z")

    def box(self, x, y, width, height, fill="#ffffff", colour=SOFT):
        """Draw a box with its upper left corner at a point of the page."""
        self._items.append(
            f'<rect x="{x}" y="{y}" width="{width}" height="{height}" rx="6" fill="{fill}"'
            f' stroke="{colour}"/>'
        )

    def words(self, at, text, kind="", anchor="middle", colour=""):
        """Write a text at a point of the page."""
        kind = f' class="{kind}"' if kind else ""
        style = f' style="fill:{colour}"' if colour else ""
        self._items.append(
            f'<text x="{at[0]:.1f}" y="{at[1]:.1f}" text-anchor="{anchor}"{kind}{style}>'
            f"{html.escape(text)}</text>"
        )

    def frame(self, pose, length, name=""):
        """Draw the axes of a frame of the map: x red, y green."""
        for axis, colour, end in (("x", RED, (length, 0.0)), ("y", GREEN, (0.0, length))):
            tip = self.at(pose.apply(end))
            self.line((self.at((pose.x, pose.y)), tip), colour, 2.0, tip=True)
            beside = self.at(pose.apply((end[0] * 1.3, end[1] * 1.3)))
            self.words((beside[0], beside[1] + 4), axis, "small", colour=colour)
        if name:
            below = self.at((pose.x, pose.y))
            self.words((below[0], below[1] + 18), name, "small")

    def floor(self, scene):
        """Draw a scene from above: floor, walls, what doors sweep, doors as they start."""
        start = start_positions(scene, ())
        for shape in (
            *plan_shapes.floor_shapes(scene),
            *plan_shapes.solid_shapes(scene, CUT),
            *(s for s in plan_shapes.swing_shapes(scene, start) if s.form != "line"),
            *plan_shapes.body_shapes(scene, start, CUT),
        ):
            fill = _FILLS[shape.role] if shape.form == "area" else "none"
            colour = RED if shape.form == "outline" else "none"
            for ring in shape.parts:
                self.line(map(self.at, ring), colour, 1.0, fill=fill, dash="4 3", ends="Z")

    def svg(self):
        """Return the file."""
        tips = "".join(
            f'<marker id="tip-{colour[1:]}" viewBox="0 0 8 8" refX="7" refY="4" markerWidth="7"'
            f' markerHeight="7" orient="auto"><path d="M0 0L8 4L0 8z" fill="{colour}"/></marker>'
            for colour in (INK, SOFT, BLUE, RED, GREEN)
        )
        return "\n".join(
            (
                f'<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 {self._width}'
                f' {self._height}" width="{self._width}" role="img">',
                f"<title>{html.escape(self._title)}</title>",
                f"<style>{_STYLE}</style><defs>{tips}</defs>",
                f'<rect width="{self._width}" height="{self._height}" rx="8" fill="#faf8f4"/>',
                *self._items,
                "</svg>\n",
            )
        )


_TWO_ROOMS = """
Floor plan: rooms
Defaults: walls: thickness: 0.2 m height: 2.5 m
Space hall:
    shape: Rectangle width=6 m, length=3 m
    location: wrt: world of: this
Space kitchen:
    shape: Rectangle width=3 m, length=2 m
    location: wrt: hall.walls[0] of: this.walls[2] translation: x: 1 m spaced
Entryway doorway:
    shape: Rectangle width=0.9 m, height=2 m
    location: in: hall.walls[0] and kitchen.walls[2] translation: x: 1 m, z: 1 m
"""


def walls():
    """Draw the numbers and frames of the walls of a room, and a room against a wall."""
    plan = parse_floorplan(_TWO_ROOMS)
    sheet = Sheet(760, 500, "Walls are numbered clockwise from the north", 74, (260, 330))
    sheet.floor(compile_scene(plan, ()))
    for space in plan.spaces:
        sheet.frame(space.frame, 0.5, space.name)
        for number, wall in enumerate(space.walls):
            if (space.name, number) == ("kitchen", 2):
                continue
            sheet.frame(wall.frame, 0.42)
            at = sheet.at(wall.frame.apply((-0.35, -0.22)))
            sheet.words((at[0], at[1] + 5), str(number), "strong", colour=BLUE)
    middle, shifted = (plan.spaces[0].walls[0].frame.apply((x, -0.75)) for x in (0.0, 1.0))
    sheet.line(map(sheet.at, (middle, shifted)), BLUE, 2.0, tip=True)
    at = sheet.at((middle[0] + 1.1, middle[1] - 0.05))
    sheet.words(at, "translation: x: 1 m", "small", "start", BLUE)
    notes = (
        ("Walls of a rectangle are 0 to 3,", ""),
        ("clockwise from the north (+y).", ""),
        ("A wall's frame: x to the right as seen", "small"),
        ("from inside, y out through the wall.", "small"),
        ("kitchen: wrt: hall.walls[0]", "small"),
        ("of: this.walls[2], x: 1 m, spaced.", "small"),
    )
    for row, (text, kind) in enumerate(notes):
        sheet.words((515, 56 + 22 * row + 8 * (row // 2)), text, kind, "start")
    return sheet.svg()


_DOORS = """
object hinged_door
    link post  box 4 cm x 4 cm   at (0 cm, 0 cm)   from 0 m to 1.98 m,    mass 50 kg
    link leaf  box 4 cm x 88 cm  at (0 cm, 47 cm)  from 1 cm to 1.98 m,   mass 15 kg
    joint hinge  revolute from post to leaf at (-2 cm, 2.5 cm), between 0 deg and 95 deg,
        friction 1 N m
    state ajar: hinge 50 deg

object sliding_door
    link panel  box 1.1 m x 4 cm  from 1 cm to 2.02 m,  mass 25 kg
    joint rail  prismatic from world to panel along x, between 0 m and 1.05 m, friction 10 N
    state ajar: rail 0.4 m
"""
_HINGED = tuple(
    f"hinge {side}, opening {to}" for to in ("inwards", "outwards") for side in ("left", "right")
)
_SLIDING = tuple(
    f"sliding {side}, on the {face}" for face in ("inside", "outside") for side in ("left", "right")
)


def _doors(kind, ways, title):
    """Draw four doors in the north wall of a hall, each with its words."""
    places = tuple(3.2 * index - 4.8 for index in range(4))
    plan = parse_floorplan(
        "Floor plan: doors\nDefaults: walls: thickness: 0.12 m height: 2.5 m\n"
        "Space hall:\n    shape: Rectangle width=13 m, length=1.6 m\n"
        "    location: wrt: world of: this\n"
        + "".join(
            f"Entryway way_{index}:\n    shape: Rectangle width=0.95 m, height=2 m\n"
            f"    location: in: hall.walls[0] translation: x: {x} m, z: 1 m\n"
            for index, x in enumerate(places)
        )
    )
    doors = "".join(
        f"door_{index} is a {kind} in way_{index}, {way}, starts ajar\n"
        for index, way in enumerate(ways)
    )
    sheet = Sheet(900, 300, title, 66, (450, 180))
    sheet.floor(compile_scene(plan, (parse_scenery(_DOORS + doors, "doors.scenery"),)))
    for x, way in zip(places, ways, strict=True):
        first, second = way.split(", ")
        at = sheet.at((x, 0.8))
        sheet.words((at[0], 262), first, "strong")
        sheet.words((at[0], 282), second, "small")
        sheet.line(((at[0], at[1] + 98), (at[0], at[1] + 66)), SOFT, 2.0, tip=True)
    sheet.words((450, 30), "outside", "small")
    sheet.words((450, 232), "inside: the arrows look at the wall", "small")
    return sheet.svg()


def hinges():
    """Draw the four ways to hang a hinged door."""
    return _doors("hinged_door", _HINGED, "Left and right of hinges, inwards and outwards")


def sliders():
    """Draw the four ways to hang a sliding door."""
    return _doors("sliding_door", _SLIDING, "Sliding doors: direction and face of the wall")


def robot():
    """Draw the footprint, the base frame and the lasers of the shuttle."""
    shuttle = load_robot(ROOT / "campaigns" / "robots" / "shuttle.yaml")
    sheet = Sheet(760, 400, "Base frame, footprint and lasers of a robot", 230, (330, 210))
    for laser in shuttle.lasers:
        pose = Pose2(laser.mount.x, laser.mount.y, laser.mount.yaw)
        span = laser.angle_max - laser.angle_min
        angles = [laser.angle_min + span * step / 40 for step in range(41)]
        arc = [pose.apply((0.6 * math.cos(a), 0.6 * math.sin(a))) for a in angles]
        sheet.area(map(sheet.at, ((pose.x, pose.y), *arc)), "#2b6fd418", "#2b6fd4")
    sheet.area(map(sheet.at, shuttle.footprint), "#2f9e6e33", GREEN)
    sheet.frame(Pose2(), 0.2, "base frame")
    for laser in shuttle.lasers:
        sheet.frame(Pose2(laser.mount.x, laser.mount.y, laser.mount.yaw), 0.12, laser.name)
    notes = (
        "footprint: around the base frame",
        "mount: {x: …, y: …, yaw: …}",
        "angle_min, angle_max: from the",
        "x axis of the laser",
        "yaw: counter-clockwise from x",
    )
    for row, text in enumerate(notes):
        sheet.words((550, 60 + 22 * row), text, "small", "start")
    return sheet.svg()


def mission():
    """Draw a start pose, waypoints with and without a yaw, and the distance of ``reached``."""
    sheet = Sheet(760, 300, "A mission: start pose, waypoints, headings", 90, (120, 150))
    start, first, last = Pose2(), Pose2(3.0, 0.8, -math.pi / 2), (5.0, -0.8)
    route = [sheet.at(point) for point in ((start.x, start.y), (first.x, first.y), last)]
    sheet.line(route, SOFT, 1.5, dash="5 4")
    sheet.frame(start, 0.5)
    sheet.words((120, 185), "start: {x: 0, y: 0, yaw: 0}", "small")
    for point, text, beside in (
        ((first.x, first.y), "{id: shelf, x: 3, y: 0.8, yaw: -90 deg}", -34),
        (last, "{id: till, x: 5, y: -0.8}: any heading", 44),
    ):
        x, y = sheet.at(point)
        ring = [
            (x + 27 * math.cos(a / 20 * math.tau), y + 27 * math.sin(a / 20 * math.tau))
            for a in range(20)
        ]
        sheet.line(ring, BLUE, 1.2, dash="3 3", ends="Z")
        sheet.area([(x + (u - x) / 6, y + (v - y) / 6) for u, v in ring], BLUE)
        sheet.words((x, y + beside), text, "small")
    tip = sheet.at(first.apply((0.55, 0.0)))
    sheet.line((sheet.at((first.x, first.y)), tip), RED, 2.0, tip=True)
    sheet.words((20, 280), "map: x to the right, y up, yaw counter-clockwise", "small", "start")
    sheet.words((740, 30), "dotted circle: reached(mission, 0.3 m)", "small", "end")
    return sheet.svg()


def margin():
    """Draw a signal over time with its limit, once kept and once violated."""
    sheet = Sheet(760, 330, "A margin is the room that was left to the limit")
    for left, low, moment, good in ((70, 0.12, 11.0, True), (440, -0.02, 7.0, False)):
        colour, base = (GREEN, RED)[not good], 270
        times = [i / 4 for i in range(73)]
        values = [0.42 - (0.42 - low) * math.exp(-(((t - moment) / 2.6) ** 2)) for t in times]

        def at(t, value, left=left, base=base):
            return (left + 15 * t, base - 430 * (value + 0.06))

        sheet.line((at(0, 0.45), at(0, -0.06), at(18, -0.06)), SOFT, 1.2)
        sheet.line((at(0, 0.05), at(18, 0.05)), INK, 1.5, dash="6 4")
        sheet.line([at(t, v) for t, v in zip(times, values, strict=True)], BLUE, 2.0)
        sheet.line((at(moment, 0.05), at(moment, low)), colour, 3.0, tip=True)
        sheet.words(at(0, 0.48), "clearance [m]", "small", "start")
        sheet.words((left + 270, base + 18), "time", "small", "end")
        sheet.words(at(0.3, 0.065), "limit 0.05 m", "small", "start")
        told = f"margin {low - 0.05:+.2f} m".replace("-", "−")
        beside = at(moment + 0.4, (0.02, 0.0)[good])
        sheet.words((beside[0] + (0, -40)[good], beside[1]), told, "strong", "start", colour)
        verdict = "✓ pass" if good else f"✗ fail at {moment:g} s"
        sheet.words((left + 135, base + 44), verdict, "strong", colour=colour)
    return sheet.svg()


_VERDICTS = (
    ("open-house", ("pass 5/5", "pass 5/5"), (GREEN, GREEN)),
    ("rude-house", ("fail 0/5", "fail 3/5 !"), (SOFT, RED)),
)


def cells():
    """Draw a small matrix with its words: cell, repeat, known, unexpected."""
    sheet = Sheet(760, 300, "Cells of a campaign: pass, known failure, unexpected failure")
    for column, system in enumerate(("pilot", "nav2")):
        sheet.words((250 + 190 * column, 36), system, "strong")
    for row, (scenario, results, colours) in enumerate(_VERDICTS):
        top = 50 + 92 * row
        sheet.words((130, top + 45), scenario, "strong", "end")
        for column, (result, colour) in enumerate(zip(results, colours, strict=True)):
            left = 160 + 190 * column
            sheet.box(left, top, 180, 78, colour=colour)
            sheet.words((left + 90, top + 30), result, "strong", colour=colour)
            passed = int(result.split()[1][0])
            for repeat in range(5):
                sign = "✓" if repeat < passed else "✗"
                sheet.words((left + 50 + 20 * repeat, top + 58), sign, colour=colour)
    notes = (
        (70, "cell: a scenario with a system"),
        (108, "each ✓ or ✗ is a repeat, one run"),
        (170, "known (grey): the campaign"),
        (188, "expects this failure"),
        (214, "unexpected (!): not as expected,"),
        (232, "so the exit code is 1"),
    )
    for y, text in notes:
        sheet.words((552, y), text, "small", "start")
    expected = "expect:  - {scenario: rude-house, sut: pilot, verdict: fail, why: doors hit it}"
    sheet.words((20, 276), expected, "small", "start")
    return sheet.svg()


def system():
    """Draw what a system under test gets and gives."""
    sheet = Sheet(760, 220, "A system under test gets odometry and scans and gives velocities")
    for x, title, below in (
        (20, "simulator", ("world, doors, robot,", "lasers, odometry")),
        (300, "system under test", ("pilot, ros, ros2,", "or a plug-in of yours")),
        (580, "trace", ("all that is judged,", "one MCAP file")),
    ):
        sheet.box(x, 60, 160, 100)
        sheet.words((x + 80, 90), title, "strong")
        for row, text in enumerate(below):
            sheet.words((x + 80, 118 + 20 * row), text, "small")
    sheet.line(((180, 85), (298, 85)), INK, 1.5, tip=True)
    sheet.words((240, 76), "scan, odometry", "small")
    sheet.line(((300, 135), (182, 135)), INK, 1.5, tip=True)
    sheet.words((240, 155), "twist (vx, vy, wz)", "small")
    sheet.line(((460, 110), (578, 110)), INK, 1.5, tip=True)
    sheet.words((520, 101), "estimate, plan", "small")
    sheet.line(((100, 160), (100, 190), (660, 190), (660, 162)), INK, 1.5, tip=True)
    sheet.words((380, 183), "true poses, contacts, doors", "small")
    sheet.words((380, 34), "goals of the mission", "small")
    sheet.line(((380, 40), (380, 58)), INK, 1.5, tip=True)
    return sheet.svg()


_FLAT = """
Floor plan: flat
Defaults: walls: thickness: 0.12 m height: 2.5 m
var width = 0.9 m
var place = 0 m
var room = 3.5 m
Space hall:
    shape: Rectangle width=5 m, length=1.6 m
    location: wrt: world of: this
Space kitchen:
    shape: Rectangle width=room, length=2 m
    location: wrt: hall.walls[0] of: this.walls[2] translation: x: 0 m spaced
    features:
        Column pillar:
            shape: Rectangle width=0.4 m, length=0.4 m
            height: 2.5 m
            location: wrt: this translation: x: place, y: 0.3 m
Entryway door:
    shape: Rectangle width=width, height=2 m
    location: in: hall.walls[0] and kitchen.walls[2] translation: x: -0.8 m, z: 1 m
"""
_VARIATION = """
import "flat.fpm"
width: uniform(0.8 m .. 1.2 m)
place: uniform(-0.2 m .. 1.1 m)
room: uniform(3 m .. 4.8 m)
"""


def variants():
    """Draw a plan and two variants of it."""
    sheet = Sheet(900, 290, "A plan and two of its variants", 50)
    with tempfile.TemporaryDirectory() as folder:
        (Path(folder) / "flat.fpm").write_text(_FLAT, "utf-8")
        variation = parse_variation(_VARIATION, "flats.variation", Path(folder))
    drawn = sample(variation, 2, seed=7)
    plans = (parse_floorplan(_FLAT), *(variant.plan for variant in drawn))
    for column, plan in enumerate(plans):
        sheet.origin = (160 + 290 * column, 190)
        sheet.floor(compile_scene(plan, ()))
        name = "flat.fpm" if column == 0 else f"variant {column}"
        sheet.words((sheet.origin[0], 255), name, "strong")
        doorway, kitchen = plan.openings[0], plan.spaces[1]
        width, room = doorway.width, max(x for x, _ in kitchen.outline) * 2
        sheet.words((sheet.origin[0], 275), f"width {width:.2f} m, room {room:.2f} m", "small")
    return sheet.svg()


def walls_layer():
    """Draw the areas of a walls layer and its entryway."""
    sheet = Sheet(760, 330, "A walls layer: spaces, what stands, a gap", 60, (60, 285))
    sheet.area(map(sheet.at, ((-0.2, -0.2), (10.2, -0.2), (10.2, 4.2), (-0.2, 4.2))), WALL)
    for name, outline in (
        ("hall", ((0, 0), (6, 0), (6, 4), (0, 4))),
        ("kitchen", ((6.2, 0), (10, 0), (10, 4), (6.2, 4))),
        ("", ((5.9, 1), (6.3, 1), (6.3, 2), (5.9, 2))),
    ):
        ring = [sheet.at(corner) for corner in outline]
        sheet.area(ring, "#ffffff")
        middle = sheet.at((sum(x for x, _ in outline) / 4, 3.2))
        sheet.words(middle, name, "strong")
    sheet.area(map(sheet.at, ((2, 1), (2.5, 1), (2.5, 1.5), (2, 1.5))), WALL)
    sheet.words(sheet.at((2.25, 0.6)), "standing: post, 1 m high", "small")
    sheet.area(map(sheet.at, ((4, 3), (4.5, 3), (4.5, 3.5), (4, 3.5))), "#d8d4cb", SOFT)
    sheet.words(sheet.at((4.25, 2.65)), "hole of hall", "small")
    sheet.line(map(sheet.at, ((6.1, 1), (6.1, 2))), RED, 2.5, tip=True)
    sheet.words(sheet.at((5.9, 1.5)), "gap: from [6.1, 1] to [6.1, 2]", "small", "end", RED)
    sheet.words(sheet.at((6.5, 1.6)), "right of the way:", "small", "start")
    sheet.words(sheet.at((6.5, 1.3)), "inwards", "small", "start")
    sheet.line(map(sheet.at, ((0, 0), (0.8, 0))), RED, 2.0, tip=True)
    sheet.line(map(sheet.at, ((0, 0), (0, 0.8))), GREEN, 2.0, tip=True)
    return sheet.svg()


DIAGRAMS = {
    "walls": walls,
    "hinges": hinges,
    "sliders": sliders,
    "robot-frames": robot,
    "mission": mission,
    "margin": margin,
    "cells": cells,
    "system": system,
    "variants": variants,
    "walls-layer": walls_layer,
}
"""Functions of the diagrams, by the name of the file."""
