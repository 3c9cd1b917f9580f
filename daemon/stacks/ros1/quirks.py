"""Oddities of the original stack that are kept for fidelity, with a switch each.

``ORIGINAL`` is the behaviour of the ROS 1 Noetic packages. ``FAST``, the default, leaves out
``inflation_queue_order`` because of its computing time. ``FIXED`` turns all oddities off, which
shows what they cost.

A file names a profile, or a profile with some switches changed.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, fields, replace
from typing import Final

from daemon.stacks.findings import FindingCollector, ParameterLocation
from grammars.text.diagnostics import did_you_mean


@dataclass(frozen=True, slots=True)
class Quirks:
    """Oddities of the original; ``False`` is the sane behaviour."""

    amcl_half_cell_shift: bool = True
    """AMCL looks its likelihood field up half a cell off, a bias of 2.5 cm in x and y (amcl
    map_t: ``MAP_GXWX`` rounds about an origin in the middle of the map)."""
    amcl_brushfire_distances: bool = True
    """AMCL's distances to obstacles spread cell by cell: the first obstacle to reach a cell counts,
    also when another one is nearer, and on a map of 5 cm they end one cell before
    ``laser_likelihood_max_dist`` (amcl ``map_update_cspace``)."""
    delayed_map_to_odom: bool = True
    """The correction map->odom is stamped ``transform_tolerance`` ahead, so a pose looked up at a
    sensor's stamp uses a correction that is older by this time (amcl_node)."""
    amcl_reversing_splits_cloud: bool = True
    """Driving backwards is two half turns to AMCL's diff models; each is wrapped, their sum is
    not, so some headings end up a full turn from others, in bins and clusters of their own (amcl
    ``AMCLOdom::UpdateAction``)."""
    unknown_becomes_free: bool = True
    """The obstacle layer merges its free default over unknown cells of the global costmap
    (costmap_2d, pre-Hydro parameters)."""
    inflation_queue_order: bool = False
    """The cost of a cell comes from the first obstacle that reaches it, which beside slanted walls
    is not always the nearest (costmap_2d ``InflationLayer::updateCosts``). On the published maps
    of building C this makes one inflated cell of 72 to 248 cheaper, by up to nine units. Off by
    default, because a run takes 1.3 to 1.5 times as long (scenario S1 with a2s)."""
    truncated_window_shift: bool = True
    """The rolling window moves by whole cells truncated toward zero, so it lags by up to one cell
    either way (costmap_2d ``updateOrigin``)."""
    planner_frees_start_cell: bool = True
    """navfn and GlobalPlanner set the cost under the robot to free in the costmap itself, for
    good."""
    navfn_corner_coordinates: bool = True
    """Path points stand at cell corners, half a cell low in x and y (navfn ``mapToWorld``)."""
    global_planner_costs_wrap: bool = True
    """Costmap value plus ``neutral_cost`` of the cells around the goal is one byte: from 256 on it
    starts at 0 again, so the cells next to walls are the cheapest (GlobalPlanner)."""
    global_planner_repeats_goal: bool = True
    """With ``old_navfn_behavior`` the goal stands twice at the end of the plan (GlobalPlanner)."""
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
    """Turning at the goal, the speed is limited so that the robot can stop, then raised to
    ``min_vel_theta`` again (base_local_planner ``LatchedStopRotateController``).
    TrajectoryPlannerROS raises it to the slowest turn on the spot."""
    goal_turn_has_own_limit: bool = True
    """At the goal TrajectoryPlannerROS turns at ``max_rotational_vel``, 1 rad/s by default,
    independent of ``max_vel_theta`` and ``min_vel_theta`` (``rotateToGoal``)."""
    resets_clear_nothing: bool = True
    """The reset recoveries look for a layer ``obstacles``, which pre-Hydro parameters call
    ``obstacle_layer``: they clear nothing (ros-planning/navigation #641, #656, #1005)."""
    rotate_reads_other_namespace: bool = True
    """The rotate recovery reads its limits from ``TrajectoryPlannerROS``, never those of DWA."""
    turn_ends_unstopped: bool = True
    """The turn on the spot ends without a command to stop: a base without a time-out turns on
    until the controller has a plan again (rotate_recovery)."""
    control_patience_survives_recovery: bool = True
    """A recovery does not restart ``controller_patience``: after the first 15 s without a command
    all recoveries run within about a second and the goal aborts (move_base)."""
    failed_replanning_ignored: bool = True
    """While the controller runs, a failed replanning changes nothing: the old plan is followed
    (move_base ``planThread``)."""


FAST: Final = Quirks()
ORIGINAL: Final = replace(FAST, inflation_queue_order=True)
FIXED: Final = Quirks(**{field.name: False for field in fields(Quirks)})
PROFILES: Final = {"fast": FAST, "original": ORIGINAL, "fixed": FIXED}
DEFAULT_PROFILE: Final = "fast"


def read_quirks(entry: object, path: ParameterLocation, report: FindingCollector) -> Quirks:
    """Return the quirks in ``entry``: the name of a profile, or ``{like: PROFILE, NAME: bool}``."""
    if isinstance(entry, str):
        return _profile(entry, path, report)
    if not isinstance(entry, Mapping):
        report.refuse(path, "must be fast, original, fixed, or switches with true or false")
        return FAST
    names = [field.name for field in fields(Quirks)]
    switches: dict[str, bool] = {}
    for name, value in entry.items():
        if name == "like":
            continue
        if name not in names:
            hint = did_you_mean(name, names)
            report.refuse((*path, name), f'there is no quirk "{name}"', hint)
        elif not isinstance(value, bool):
            report.refuse((*path, name), f"must be true or false (given: {value!r})")
        else:
            switches[name] = value
    profile = _profile(entry.get("like", DEFAULT_PROFILE), (*path, "like"), report)
    return replace(profile, **switches)


def _profile(name: object, path: ParameterLocation, report: FindingCollector) -> Quirks:
    if isinstance(name, str) and name in PROFILES:
        return PROFILES[name]
    report.refuse(path, f'there are no quirks "{name}"', did_you_mean(str(name), PROFILES))
    return FAST
