"""Every oddity of the original stack that is kept for fidelity: a switch each, in one place.

The default of each switch is what the ROS 1 Noetic packages do. ``FIXED`` turns all of them off,
so that people see what an oddity costs them.
"""

from __future__ import annotations

from dataclasses import dataclass, fields
from typing import Final


@dataclass(frozen=True, slots=True)
class Quirks:
    """What the original does that nobody would ask for; ``False`` is the sane behaviour."""

    amcl_half_cell_shift: bool = True
    """AMCL looks its likelihood field up half a cell off, a bias of 2.5 cm in x and y (amcl
    map_t: ``MAP_GXWX`` rounds about an origin in the middle of the map)."""
    delayed_map_to_odom: bool = True
    """The correction map->odom is stamped ``transform_tolerance`` ahead, so poses looked up at a
    sensor's stamp use the correction of that much earlier (amcl_node)."""
    amcl_reversing_splits_cloud: bool = True
    """Driving backwards is two half turns to AMCL's diff models; each is wrapped, their sum is
    not, so some headings end up a full turn from others, in bins and clusters of their own (amcl
    ``AMCLOdom::UpdateAction``)."""
    unknown_becomes_free: bool = True
    """The obstacle layer merges its free default over unknown cells of the global costmap
    (costmap_2d, pre-Hydro parameters)."""
    truncated_window_shift: bool = True
    """The rolling window moves by whole cells truncated toward zero, so it lags by up to one cell
    either way (costmap_2d ``updateOrigin``)."""
    planner_frees_start_cell: bool = True
    """navfn sets the cost under the robot to free in the costmap itself, for good."""
    navfn_corner_coordinates: bool = True
    """Path points stand at cell corners, half a cell low in x and y (navfn ``mapToWorld``)."""
    dispatcher_clears_square: bool = True
    """Every make_plan request of the dispatcher clears a square of twice ``clearing_radius``
    around the robot in both costmaps (move_base ``planService``)."""
    plans_reset_oscillation: bool = True
    """Each new global plan resets the oscillation flags of DWA, five times a second."""
    strafe_leaks: bool = True
    """With no sideways acceleration the measured sideways speed is still sampled (DWA sample
    generator), so tiny strafe commands leak out of a differential robot."""
    perimeter_only: bool = True
    """The obstacle critic looks at the outline of the footprint, not at its inside."""
    rotation_raised_to_minimum: bool = True
    """Turning at the goal, the speed is raised to ``min_vel_theta`` again after it was limited so
    that the robot could stop (base_local_planner ``LatchedStopRotateController``)."""
    resets_clear_nothing: bool = True
    """The reset recoveries look for a layer ``obstacles``, which pre-Hydro parameters call
    ``obstacle_layer``: they clear nothing (ros-planning/navigation #641, #656, #1005)."""
    rotate_reads_other_namespace: bool = True
    """The rotate recovery reads its limits from ``TrajectoryPlannerROS``, so the limits of DWA
    mean nothing to it."""
    turn_ends_unstopped: bool = True
    """The turn on the spot ends without a command to stop: a base without a time-out turns on
    until the controller has a plan again (rotate_recovery)."""
    control_patience_survives_recovery: bool = True
    """A recovery does not restart ``controller_patience``: after the first 15 s without a command
    all recoveries run within about a second and the goal aborts (move_base)."""
    failed_replanning_ignored: bool = True
    """While the controller runs, a failed replanning changes nothing: the old plan is followed
    (move_base ``planThread``)."""


ORIGINAL: Final = Quirks()
FIXED: Final = Quirks(**{field.name: False for field in fields(Quirks)})
PROFILES: Final = {"original": ORIGINAL, "fixed": FIXED}
