"""A small world with everything artefacts show: two rooms, doors, a slider, a cabinet."""

import math

from grammars.model.behaviour import Hold, Jump, KeyFrame, KeyFrames, Spring, Trigger
from grammars.model.geometry import Pose2
from grammars.model.mission import Mission, Waypoint
from grammars.model.robot import Drive, Laser, Mount, OdometryNoise, Robot
from grammars.model.scene import Doorway, Joint, Link, Region, Scene, SceneObject, Solid
from templates.world import ArtefactWorld, BehaviourDraw, ExportJob

HERE = Pose2()
ROUND = ((0.2, 0.0), (0.06, 0.19), (-0.16, 0.12), (-0.16, -0.12), (0.06, -0.19))


def box(x0, y0, x1, y1):
    return ((x0, y0), (x1, y0), (x1, y1), (x0, y1))


def clockwise(x0, y0, x1, y1):
    """Return a box as building models have them."""
    return box(x0, y0, x1, y1)[::-1]


def wall(ring, z_min=0.0, z_max=2.5):
    return Solid("wall", "wall", ring, z_min, z_max)


def two_rooms(pose=HERE, objects=()):
    """Return two rooms, 2 m by 2 m, a doorway of 1 m between them, a window on the left."""
    solids = [
        wall(clockwise(2.0, 0.0, 2.2, 0.5)),
        wall(clockwise(2.0, 1.5, 2.2, 2.0)),
        wall(clockwise(2.0, 0.5, 2.2, 1.5), 2.0, 2.5),
        wall(clockwise(-0.2, -0.2, 4.4, 0.0)),
        wall(clockwise(-0.2, 2.0, 4.4, 2.2)),
        wall(clockwise(4.2, 0.0, 4.4, 2.0)),
        wall(clockwise(-0.2, 0.0, 0.0, 2.0), 0.0, 0.9),
        wall(clockwise(-0.2, 0.0, 0.0, 2.0), 1.6, 2.5),
    ]
    moved = tuple(
        Solid(s.owner, s.kind, pose.apply_ring(s.polygon), s.z_min, s.z_max) for s in solids
    )
    rooms = {"left": clockwise(0.0, 0.0, 2.0, 2.0), "right": clockwise(2.2, 0.0, 4.2, 2.0)}
    regions = tuple(Region(name, pose.apply_ring(ring)) for name, ring in rooms.items())
    opening = pose.apply_ring(clockwise(2.0, 0.5, 2.2, 1.5))
    doorway = Doorway("doorway", pose, opening, 1.0, 0.0, 2.0)
    return Scene("rooms", regions, (doorway,), moved, objects)


def hinged(name, x, y, *, frozen=False, at=0.0):
    post = Link("post", (box(-0.02, -0.02, 0.02, 0.02),), 50.0, 0.0, 2.0)
    leaf = Link("leaf", (box(-0.02, 0.03, 0.02, 0.95),), 15.0, 0.01, 1.98)
    hinge = Joint(
        "hinge", "revolute", "post", "leaf", (-0.02, 0.025), (1.0, 0.0), 0.0, 1.9,
        friction=1.0, stiffness=2.0, damping=0.5, rest=0.1,
    )  # fmt: skip
    pose = Pose2(x, y, math.pi / 6)
    return SceneObject(name, "door", pose, (post, leaf), (hinge,), (at,), frozen=frozen)


def slider():
    panel = Link("panel", (box(-0.5, -0.02, 0.5, 0.02),), 25.0, 0.01, 2.0)
    side = math.sqrt(0.5)
    rail = Joint("rail", "prismatic", "world", "panel", (0.0, 0.0), (side, side), 0.0, 1.0)
    return SceneObject("slider", "sliding", Pose2(1.0, 1.5), (panel,), (rail,), (0.25,))


def cabinet():
    foot = Link("world", (ROUND, box(0.0, 0.0, 0.5, 0.1)), 8.0, 0.0, 0.7)
    return SceneObject("cabinet", "cabinet", Pose2(3.5, 0.6, 1.0), (foot,), (), ())


def walker():
    """Return a body on two shapeless carriers, at (1, 2) and turned, with a bag that swings."""
    links = (
        Link("x_carrier", (), 0.0, 0.0, 0.0),
        Link("y_carrier", (), 0.0, 0.0, 0.0),
        Link("person", (box(-0.2, -0.2, 0.2, 0.2),), 70.0, 0.0, 1.8),
        Link("bag", (box(0.2, -0.05, 0.4, 0.05),), 3.0, 0.5, 0.8),
    )
    joints = (
        Joint("x", "prismatic", "world", "x_carrier", (0.0, 0.0), (1.0, 0.0), -1e4, 1e4),
        Joint("y", "prismatic", "x_carrier", "y_carrier", (0.0, 0.0), (0.0, 1.0), -1e4, 1e4),
        Joint("yaw", "revolute", "y_carrier", "person", (0.0, 0.0), (0.0, 0.0), -1e4, 1e4),
        Joint("strap", "revolute", "person", "bag", (0.2, 0.0), (0.0, 0.0), -1.0, 1.0),
    )
    return SceneObject(
        "walker", "walker", Pose2(3.0, -2.0, 0.4), links, joints, (1.0, 2.0, math.pi / 2, 0.0)
    )


def scene():
    things = (
        hinged("entrance", 2.1, 0.5),
        hinged("other", 0.5, 0.6, at=0.3),
        hinged("stuck", 3.0, 1.4, frozen=True, at=1.1),
        slider(),
        cabinet(),
    )
    return two_rooms(objects=things)


def robot():
    drive = Drive("differential", 1.0, 0.0, 1.0, 1.0, 0.0, 1.0, 100.0, 50.0, 0.5)
    laser = Laser(Mount(0.1), 0.25, -1.5, 1.5, 10, 0.05, 5.0, 10.0, 0.0, 0.0)
    return Robot("cart", box(-0.2, -0.15, 0.2, 0.15), 0.3, 40.0, drive, laser,
                 OdometryNoise(20.0, 0.0, 0.0, 0.0))  # fmt: skip


def mission(name="rounds"):
    stops = (Waypoint("a", 1.5, 1.5), Waypoint("b", 3.8, 1.7, 0.5), Waypoint("a", 1.5, 1.5))
    return Mission(name, Pose2(0.4, 0.3, 0.7), stops)


BEHAVIOURS = (
    Trigger("entrance.hinge", 1.4, 0.0, 1.3, Spring(0.5, 0.0)),
    KeyFrames("slider.rail", (KeyFrame(5.0, 1.0), KeyFrame(9.5, 0.0)), Jump()),
)
OTHERS = (
    Hold("entrance.hinge", 1.7),
    KeyFrames("slider.rail", (KeyFrame(0.0, 0.5),), Jump()),
)


def world(name="errand", *draws, **more):
    chosen = draws or (BehaviourDraw("", BEHAVIOURS),)
    made = ArtefactWorld(name, scene(), mission=mission(), robot=robot(), draws=chosen)
    return ArtefactWorld(
        **({f: getattr(made, f) for f in ArtefactWorld.__dataclass_fields__} | more)
    )


def job(folder, name="errand", *draws, **more):
    return ExportJob(world(name, *draws, **more), folder)
