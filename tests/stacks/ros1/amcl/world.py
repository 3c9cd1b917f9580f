"""Rooms on grids, scans of them, and the parameters of the published configurations."""

import numpy as np

from daemon.stacks.ros1.amcl import AmclParameters
from grammars.model.robot import Laser, Mount
from tests.stacks.pilot.world import cast, draw, edges

LASER = Laser(Mount(0.3), 0.3, -1.57, 1.57, 150, 0.05, 5.6, 10.0, 0.01, 0.0)
PUBLISHED = AmclParameters(
    min_particles=500, max_particles=2000, update_min_d=0.1, update_min_a=0.25,
    recovery_alpha_slow=0.0, recovery_alpha_fast=0.0, odom_model_type="omni-corrected",
    odom_alpha1=0.1, odom_alpha2=0.1, odom_alpha3=0.1, odom_alpha4=0.15, transform_tolerance=0.5,
)  # fmt: skip


_EDGE = 0.3


def a_room(width, depth, thickness):
    """Four walls around free space whose lower-left corner is (0.3, 0.3), painted outwards."""
    t, right, top = thickness, _EDGE + width, _EDGE + depth
    return [
        (_EDGE - t, _EDGE - t, right + t, _EDGE),
        (_EDGE - t, top, right + t, top + t),
        (_EDGE - t, _EDGE - t, _EDGE, top + t),
        (right, _EDGE - t, right + t, top + t),
    ]


def map_of(walls):
    """Draw walls on cells of 5 cm."""
    return draw(walls, (max(box[2] for box in walls) + 0.1, max(box[3] for box in walls) + 0.1))


def see(walls, pose, random=None, laser=LASER):
    """What a laser measures at ``pose``, float32, with noise when ``random`` is given."""
    segments = np.vstack([edges(box) for box in walls])
    angles = np.linspace(laser.angle_min, laser.angle_max, laser.rays)
    ranges = cast(segments, pose @ laser.mount, angles, laser.range_max)
    if random is not None:
        ranges += laser.noise * random.standard_normal(len(ranges))
    return ranges.astype(np.float32)
