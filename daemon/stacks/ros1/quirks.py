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

    # map_t: ``MAP_GXWX`` rounds about an origin in the middle of the map.
    amcl_half_cell_shift: bool = True
    """AMCL reads its likelihood field half a cell off: 2.5 cm in x and y."""
    # amcl ``map_update_cspace``.
    amcl_brushfire_distances: bool = True
    """AMCL's distances to obstacles spread cell by cell: the first obstacle to reach a cell counts,
    not the nearest. They end one cell early on a map of 5 cm."""
    # amcl_node.
    delayed_map_to_odom: bool = True
    """The correction map->odom is stamped ``transform_tolerance`` ahead, so poses at a sensor's
    stamp use an older one."""
    # amcl ``AMCLOdom::UpdateAction``.
    amcl_reversing_splits_cloud: bool = True
    """Driving backwards is two half turns to AMCL's diff models, whose sum is not wrapped: some
    headings end up a full turn off, in clusters of their own."""
    unknown_becomes_free: bool = True
    """The obstacle layer writes free over unknown cells of the global costmap (pre-Hydro
    parameters)."""
    # costmap_2d ``InflationLayer::updateCosts``. On the published maps of building C this makes one
    # inflated cell of 72 to 248 cheaper, by up to nine units (time: scenario S1 with a2s).
    inflation_queue_order: bool = False
    """The first obstacle that reaches a cell gives its cost, not always the nearest. Off by
    default: runs take 1.3 to 1.5 times as long."""
    # costmap_2d ``updateOrigin``.
    truncated_window_shift: bool = True
    """The rolling window moves by whole cells, truncated: it lags by up to one."""
    planner_frees_start_cell: bool = True
    """navfn and GlobalPlanner free the cell under the robot in the costmap itself, for good."""
    # navfn ``mapToWorld``.
    navfn_corner_coordinates: bool = True
    """navfn's path points stand at cell corners, half a cell low in x and y."""
    global_planner_costs_wrap: bool = True
    """Around the goal, GlobalPlanner adds ``neutral_cost`` to a cost in one byte: it wraps at 256,
    so cells next to walls are the cheapest."""
    global_planner_repeats_goal: bool = True
    """With ``old_navfn_behavior`` GlobalPlanner ends its plan with the goal twice."""
    # move_base ``planService``.
    dispatcher_clears_square: bool = True
    """Each plan the dispatcher requests clears a square of twice ``clearing_radius`` in both
    costmaps."""
    plans_reset_oscillation: bool = True
    """Each new global plan resets the oscillation flags of DWA."""
    # DWA ``SimpleTrajectoryGenerator``.
    strafe_leaks: bool = True
    """Without sideways acceleration DWA still samples the measured sideways speed: a differential
    robot gets tiny strafe commands."""
    perimeter_only: bool = True
    """The obstacle critic checks the outline of the footprint, not its inside."""
    # base_local_planner ``LatchedStopRotateController``.
    rotation_raised_to_minimum: bool = True
    """At the goal, DWA slows a turn so that the robot can stop, then raises it to ``min_vel_theta``
    again; TrajectoryPlannerROS likewise."""
    # base_local_planner ``rotateToGoal``.
    goal_turn_has_own_limit: bool = True
    """At the goal TrajectoryPlannerROS turns at ``max_rotational_vel``, whatever ``max_vel_theta``
    and ``min_vel_theta`` say."""
    # Also ros-planning/navigation #656 and #1005.
    resets_clear_nothing: bool = True
    """Resets look for a layer ``obstacles``, which pre-Hydro parameters call ``obstacle_layer``:
    they clear nothing (ros-planning/navigation #641)."""
    rotate_reads_other_namespace: bool = True
    """The rotate recovery reads its limits from ``TrajectoryPlannerROS``, never from DWA."""
    turn_ends_unstopped: bool = True
    """The rotate recovery ends without a stop: a base without a time-out turns on until the next
    command."""
    control_patience_survives_recovery: bool = True
    """A recovery does not restart ``controller_patience``: after it, all recoveries run within
    about a second and the goal aborts."""
    # move_base ``planThread``.
    failed_replanning_ignored: bool = True
    """While the controller runs, a failed replanning changes nothing: it follows the old plan."""


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
