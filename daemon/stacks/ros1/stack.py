"""The ROS stack as a system under test: its nodes, and the order of events within one instant.

The original runs as threads and processes whose order at one instant depends on the machine. Here
time stands still while a node works, and the events of an instant happen in this order:

1. **Odometry** enters the transform buffer.
2. **Scans** whose odometry is known go to AMCL, which broadcasts its correction (with a stamp
   ``transform_tolerance`` ahead). A scan waits for the first odometry sample that is not older, as
   in the message filter of the original: one or two instants at odometry every 51 ms. Scans of
   several lasers at one instant come in the order of the robot's lasers.
3. **Observation buffers** release a scan to the costmaps when its transforms are known up to
   50 ms beyond its stamp (a tolerance of costmap_2d), so it is one or two instants older still.
4. **Global costmap**, 5. **local costmap**: one update cycle each when due, first at time 0.
6. **Planner thread** when due or woken.
7. **Control loop** or the recovery that blocks it.
8. **Dispatcher**: takes the result of the goal at once and sends the next goal, for which the
   control loop runs its first cycle at once.

The control loop sees a plan at the instant it is made (6 before 7). In the original, planning took
5 to 20 ms of the 100 ms between two control cycles, and the two threads have no fixed phase: a
plan reaches the controller at the next cycle. Waiting for the cycle after that would multiply the
delay by ten. If the control loop asks for a plan, the thread has already had its turn: the plan is
made at the next instant and used by the next control cycle, as in the original.

An instant is a step of the stack: a multiple of 10 ms that divides the period of the control
loop and of the turn on the spot, 50 ms with the parameters of the paper. With frequencies that
fit no multiple of 10 ms a step is 10 ms, and an event happens at the first step that is not too
early.

If AMCL gets no scans, odom keeps its initial pose in the map (the original would wait for that
transform for ever and drive nowhere).
"""

from __future__ import annotations

import math
from collections import deque
from collections.abc import Collection
from functools import partial

import numpy as np

from daemon.model.sut import (
    TICK_RATE,
    Briefing,
    Decision,
    LaserScan,
    Observation,
)
from daemon.stacks.ros1.amcl.node import Amcl, AmclPose
from daemon.stacks.ros1.configuration import RosParameters
from daemon.stacks.ros1.costmap.costmap import Costmap
from daemon.stacks.ros1.costmap.layers import LayeredCostmap
from daemon.stacks.ros1.dwa.controller import Dwa
from daemon.stacks.ros1.move_base.control import MoveBase, MoveBaseStatus, PlannerThread
from daemon.stacks.ros1.move_base.dispatcher import WaypointDispatcher
from daemon.stacks.ros1.move_base.recoveries import make_recoveries
from daemon.stacks.ros1.navfn import GlobalPlannerParameters
from daemon.stacks.ros1.navfn.planner import GlobalPlanner, Navfn
from daemon.stacks.ros1.scan_buffer import ObservedCostmap, ScanBuffer
from daemon.stacks.ros1.telemetry import StackRecorder
from daemon.stacks.ros1.timers import TIME_TOLERANCE, UpdateTimer
from daemon.stacks.ros1.trajectory_planner import TrajectoryPlannerParameters
from daemon.stacks.ros1.trajectory_planner.controller import TrajectoryPlanner
from daemon.stacks.ros1.transforms import CostmapFrame, TransformBuffer
from grammars.model.geometry import Floats


class RosStack:
    """The ROS navigation stack; fulfils ``daemon.model.sut.SystemUnderTest``.

    The module documents the order of events in :meth:`update`.
    """

    needs_ground_truth = False

    def __init__(self, parameters: RosParameters) -> None:
        self.parameters = parameters
        self.period = common_step(
            parameters.move_base.controller_frequency, parameters.rotate_recovery.frequency
        )
        """Seconds of simulated time between two updates."""

    def start(self, briefing: Briefing) -> None:
        """Start the nodes; raises ``ValueError`` for parameters that do not fit the map."""
        p, lasers = self.parameters, briefing.robot.lasers
        # First, because its kernels take longest to compile.
        controller = _make_controller(p, p.local_costmap.padded_footprint())
        self._transforms = TransformBuffer(
            briefing.start, p.amcl.transform_tolerance, delayed=p.quirks.delayed_map_to_odom
        )
        self._amcl = Amcl(p.amcl, p.quirks, briefing.map, lasers, briefing.start, briefing.seed)
        self._pose = briefing.start
        """Latest pose that AMCL published."""
        self._broadcasts = False
        wiring = p.topics.wire([laser.name for laser in lasers])
        self._heard_by_amcl = wiring.amcl
        self._unprocessed_scans: deque[LaserScan] = deque(maxlen=100 * len(lasers))
        self._scans = ScanBuffer(lasers, self._transforms, keep=_longest_kept(p))
        self._global = self._observed(p.global_costmap, wiring.global_costmap, briefing)
        self._local = self._observed(p.local_costmap, wiring.local_costmap, briefing)
        self._global_timer = UpdateTimer(p.global_costmap.update_frequency)
        self._local_timer = UpdateTimer(p.local_costmap.update_frequency)
        self._set_up_move_base(controller)
        self._dispatcher = WaypointDispatcher(
            p.dispatcher, briefing.mission.waypoints, self._move_base.serve_plan
        )
        # The spread of the particles AMCL begins with.
        spread = np.diag((p.amcl.initial_cov_xx, p.amcl.initial_cov_yy, p.amcl.initial_cov_aa))
        near = p.local_costmap
        self._telemetry = StackRecorder(spread, near.publish_frequency, near.frame)
        self._events = self._status.log

    def _observed(
        self, layered: LayeredCostmap, audible: Collection[str], briefing: Briefing
    ) -> ObservedCostmap:
        p, names = self.parameters, [laser.name for laser in briefing.robot.lasers]
        hears = partial(p.topics.lasers_on, lasers=names)
        footprint = layered.padded_footprint()
        costmap = Costmap(layered, footprint, p.quirks, briefing.map, hears)
        frame = CostmapFrame(layered.frame, self._transforms)
        return ObservedCostmap(costmap, frame, self._scans, audible)

    def _set_up_move_base(self, controller: Dwa | TrajectoryPlanner) -> None:
        p = self.parameters
        recoveries = make_recoveries(
            p.move_base, p.rotate_recovery, p.resets, p.quirks,
            p.local_costmap.padded_footprint(), self._global, self._local,
        )  # fmt: skip
        self._status = MoveBaseStatus()
        self._planner = PlannerThread(
            p.move_base, p.quirks, self._status, _make_global_planner(p), self._global
        )
        self._move_base = MoveBase(
            p.move_base, p.quirks, self._status, self._planner, controller,
            recoveries, self._global, self._local,
        )  # fmt: skip

    def update(self, observation: Observation) -> Decision:
        """Take the observation, run every node that is due, and return the decision."""
        # The numbers refer to the module's docstring.
        now = observation.time
        for sample in observation.odometry:  # 1
            self._transforms.move(sample)
        for scan in observation.scans:
            self._unprocessed_scans.append(scan)
            self._scans.queue(scan)
        # Without odometry there are no transforms, so no node can work.
        if self._transforms.time < 0.0:
            return Decision(None, self._dispatcher.progress)
        published = self._localise()  # 2
        self._scans.release_known(now)  # 3
        if self._global_timer.due(now):  # 4
            self._global.update()
        if self._local_timer.due(now):  # 5
            self._local.update()
        self._planner.step(now)  # 6
        self._move_base.step(now)  # 7
        self._dispatch(now)  # 8
        return self._decide(now, published)

    def _localise(self) -> AmclPose | None:
        """Give AMCL the scans whose odometry is known, and broadcast its correction."""
        latest = None
        horizon = self._transforms.time + TIME_TOLERANCE
        while self._unprocessed_scans and self._unprocessed_scans[0].time <= horizon:
            scan = self._unprocessed_scans.popleft()
            if scan.laser not in self._heard_by_amcl:
                continue
            odom = self._transforms.base_at(scan.time)
            published = self._amcl.scan(scan.time, scan.ranges, odom, scan.laser)
            if published is not None:
                latest, self._pose = published, published.pose
                self._broadcasts = True
            # The first broadcast is at the first publication, later ones at every scan.
            if self._broadcasts:
                self._transforms.correct(scan.time, self._amcl.map_to_odom)
        return latest

    def _dispatch(self, now: float) -> None:
        before, result = self._dispatcher.progress, self._move_base.take_result()
        goal = self._dispatcher.step(now, result, self._pose)
        after = self._dispatcher.progress
        if result == "succeeded":
            self._events.append(f"waypoint {after.reached} reached")
        if after.state != before.state:
            self._events.append(f"mission {after.state}")
        if goal is not None:
            number = after.reached + 1
            self._events.append(f"goal {number} sent: {goal.x:.2f}, {goal.y:.2f}, {goal.yaw:.2f}")
            # In odom the goal keeps its present position (``goalToGlobalFrame``).
            self._move_base.accept(now, self._global.frame.take(goal))

    def _decide(self, now: float, published: AmclPose | None) -> Decision:
        transforms, telemetry, wide = self._transforms, self._telemetry, self._global.frame
        if published is None:
            odom, base = transforms.map_to_odom, transforms.odom_to_base
            estimate, cloud = telemetry.dead_reckoned(transforms.time, odom, base), None
            particles = None
        else:
            estimate, cloud = telemetry.published(published)
            particles = telemetry.particles(now, self._amcl.particles)
        plan_frame = None if wide.name == "map" else wide.in_map
        plan = telemetry.plan(now, self._status.plan, plan_frame)
        local_plan = telemetry.local_plan(
            now, self._move_base.take_trajectory(), self._local.frame.in_map
        )
        costmap = telemetry.costmap(now, self._local.costmap.grid)
        command, progress = self._move_base.take_command(), self._dispatcher.progress
        events = tuple(self._events)
        self._events.clear()
        return Decision(
            command, progress, estimate, cloud, plan, local_plan, events, particles, costmap
        )


def _make_global_planner(parameters: RosParameters) -> Navfn | GlobalPlanner:
    settings = parameters.global_planner
    if isinstance(settings, GlobalPlannerParameters):
        return GlobalPlanner(settings, parameters.quirks)
    return Navfn(settings, parameters.quirks)


def _make_controller(parameters: RosParameters, footprint: Floats) -> Dwa | TrajectoryPlanner:
    """Return the local planner; ``footprint`` (k, 2) [m] is padded."""
    settings, quirks, move_base = parameters.local_planner, parameters.quirks, parameters.move_base
    period = 1.0 / move_base.controller_frequency
    if isinstance(settings, TrajectoryPlannerParameters):
        return TrajectoryPlanner(settings, quirks, footprint, period)
    # DWA finds this parameter in move_base's own namespace.
    latch = move_base.latch_xy_goal_tolerance
    return Dwa(settings, quirks, footprint, period, latch_goal=latch)


def _longest_kept(parameters: RosParameters) -> float:
    """Return the longest persistence of scans in any source of either costmap [s]."""
    costmaps = (parameters.global_costmap, parameters.local_costmap)
    sources = [source for costmap in costmaps for _, source in costmap.laser_sources()]
    return max((source.observation_persistence for source in sources), default=0.0)


def common_step(*frequencies: float) -> float:
    """Return the longest step [s], in whole ticks, that fits all ``frequencies`` [Hz].

    Returns one tick if no step fits.
    """
    ticks = [TICK_RATE / frequency for frequency in frequencies]
    if any(abs(tick - round(tick)) > 1e-6 for tick in ticks):
        return 1.0 / TICK_RATE
    return math.gcd(*(round(tick) for tick in ticks)) / TICK_RATE
