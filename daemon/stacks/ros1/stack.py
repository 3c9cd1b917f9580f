"""The stack as a system under test: its nodes, and the order of events within one instant.

The original runs as threads and processes whose order at one instant is up to the machine. Here
time stands still while anybody works, and everything due at an instant happens in this order:

1. **Odometry** enters the transform buffer.
2. **Scans** whose odometry is known go to AMCL, which broadcasts its correction (with a stamp
   ``transform_tolerance`` ahead). A scan waits for the first odometry sample that is not older, at
   51 ms an instant or two, as in the message filter of the original. Of several lasers those of
   one instant come in the order of the robot's.
3. **Observation buffers**: a laser's latest scan for the costmaps becomes one whose transforms are
   known up to 50 ms beyond its stamp, a tolerance of costmap_2d, so it is one or two instants older
   still.
4. **Global costmap**, 5. **local costmap**: one update cycle each when due, first at time 0.
6. **Planner thread** when due or woken.
7. **Control loop** or the recovery that blocks it.
8. **Dispatcher**: takes the result of the goal at the instant it is known and sends the next one,
   for which the control loop runs its first cycle at once.

A plan is there for the control loop at the instant it is made (6 before 7). In the original
planning took 5 to 20 ms of the 100 ms between two control cycles and the two threads have no
fixed phase: a plan reaches the controller at the next cycle after that. Making it wait for the
cycle after the next would add ten times the delay there was. A plan that the control loop asks
for is made at the next instant, as the thread has had its turn by then, and used by the next
control cycle: as in the original.

An instant is a step of the stack: a multiple of 10 ms that divides the period of the control
loop and of the turn on the spot, 50 ms with the parameters of the paper. With frequencies that
fit no multiple of 10 ms a step is 10 ms, and what is due happens at the first step not before.

If AMCL gets no scans, odom stays where it was in the map at the start (the original would wait
for that transform for ever and drive nowhere).
"""

from __future__ import annotations

import math
from collections import deque
from collections.abc import Collection

import numpy as np

from daemon.model.sut import (
    TICK_RATE,
    Briefing,
    Cloud,
    Decision,
    Estimate,
    LaserScan,
    Observation,
)
from daemon.stacks.ros1.amcl import AmclParameters
from daemon.stacks.ros1.amcl.node import Amcl, AmclPose
from daemon.stacks.ros1.configuration import RosParameters
from daemon.stacks.ros1.costmap.costmap import Costmap
from daemon.stacks.ros1.costmap_sources import laser_sources
from daemon.stacks.ros1.dwa import Dwa
from daemon.stacks.ros1.frames import CostmapFrame
from daemon.stacks.ros1.global_planner import GlobalPlannerParameters
from daemon.stacks.ros1.global_planner.planner import GlobalPlanner
from daemon.stacks.ros1.move_base import (
    ClearTarget,
    ClearTargets,
    MoveBase,
    MoveBaseStatus,
    PlannerThread,
    TransformBuffer,
    WaypointDispatcher,
    make_recoveries,
)
from daemon.stacks.ros1.navfn.planner import Navfn
from daemon.stacks.ros1.nodes import LocalController, ObservedCostmap, PlanMaker
from daemon.stacks.ros1.planners import GlobalPlannerChoice, LocalPlannerChoice
from daemon.stacks.ros1.quirks import Quirks
from daemon.stacks.ros1.scan_buffer import ScanBuffer
from daemon.stacks.ros1.telemetry import (
    CostmapRecorder,
    EstimateRecorder,
    LocalPlanRecorder,
    PlanRecorder,
)
from daemon.stacks.ros1.timers import TIME_TOLERANCE, UpdateTimer
from daemon.stacks.ros1.trajectory_planner import TrajectoryPlanner, TrajectoryPlannerParameters
from grammars.model.geometry import Floats, Pose2


class Navigation:
    """All nodes of the stack for one run; the order of :meth:`update` is documented in
    :mod:`daemon.stacks.ros1.stack`."""

    def __init__(self, briefing: Briefing, parameters: RosParameters) -> None:
        self._parameters = parameters
        quirks, robot = parameters.quirks, briefing.robot
        self._transforms = TransformBuffer(
            briefing.start,
            parameters.amcl.transform_tolerance,
            delayed=quirks.delayed_map_to_odom,
        )
        self._amcl = Amcl(
            parameters.amcl, quirks, briefing.map, robot.lasers, briefing.start, briefing.seed
        )
        self._pose = briefing.start
        """What AMCL has published last."""
        self._broadcasts = False
        self._wiring = parameters.topics.heard([laser.name for laser in robot.lasers])
        self._unprocessed_scans: deque[LaserScan] = deque(maxlen=100 * len(robot.lasers))
        self._scans = ScanBuffer(robot.lasers, self._transforms, keep=_longest_kept(parameters))
        self._set_up_costmaps(briefing)
        self._set_up_move_base(briefing)
        self._plans, self._local_plans = PlanRecorder(), LocalPlanRecorder()
        near = parameters.local_costmap
        self._costmaps = CostmapRecorder(near.publish_frequency, near.frame)
        self._estimates = EstimateRecorder(_start_covariance(parameters.amcl))
        self._events: list[str] = []
        self._idle: Decision | None = None
        """The answer when there is nothing new."""

    def _set_up_costmaps(self, briefing: Briefing) -> None:
        quirks, topics = self._parameters.quirks, self._parameters.topics
        wide, near = self._parameters.global_costmap, self._parameters.local_costmap
        lasers = [laser.name for laser in briefing.robot.lasers]

        def hears(topic: str) -> Collection[str]:
            return topics.lasers_on(topic, lasers)

        self._global = ObservedCostmap(
            Costmap(wide, wide.padded_footprint(), quirks, briefing.map, hears),
            CostmapFrame(wide.frame, self._transforms), self._scans, self._wiring.global_costmap,
        )  # fmt: skip
        self._local = ObservedCostmap(
            Costmap(near, near.padded_footprint(), quirks, briefing.map, hears),
            CostmapFrame(near.frame, self._transforms), self._scans, self._wiring.local_costmap,
        )  # fmt: skip
        self._global_timer = UpdateTimer(wide.update_frequency)
        self._local_timer = UpdateTimer(near.update_frequency)

    def _set_up_move_base(self, briefing: Briefing) -> None:
        p = self._parameters
        footprint = p.local_costmap.padded_footprint()
        plans = PlanMaker(
            _make_global_planner(p.global_planner, p.quirks), self._global, self._local,
            p.move_base.clearing_radius if _clears_square(p) else None,
        )  # fmt: skip
        local_planner = _make_local_planner(
            p.local_planner, p.quirks, footprint, 1.0 / p.move_base.controller_frequency,
            latch_goal=p.move_base.latch_xy_goal_tolerance,
        )  # fmt: skip
        self._controller = LocalController(
            local_planner, self._transforms, self._local, self._global.frame
        )
        recoveries = make_recoveries(
            p.move_base, p.rotate_recovery, p.resets, p.quirks, footprint, self._local.costmap.grid,
            ClearTargets(
                ClearTarget(self._global.costmap.clear_layers, self._global.update),
                ClearTarget(self._local.costmap.clear_layers, self._local.update),
            ),
        )  # fmt: skip
        self._status = MoveBaseStatus()
        self._planner = PlannerThread(p.move_base, p.quirks, self._status, plans.plan)
        self._move_base = MoveBase(
            p.move_base, p.quirks, self._status, self._planner, self._controller, recoveries,
            plans.robot_poses,
        )  # fmt: skip
        waypoints = briefing.mission.waypoints
        self._dispatcher = WaypointDispatcher(p.dispatcher, waypoints, plans.serve)

    def update(self, observation: Observation) -> Decision:
        """Take what is new and let every node that is due do its work."""
        # The numbers are those of the order in this module's docstring.
        now = observation.time
        for sample in observation.odometry:  # 1
            self._transforms.move(sample)
        for scan in observation.scans:
            self._unprocessed_scans.append(scan)
            self._scans.queue(scan)
        # Without odometry there is no transform to look anything up in, and nobody can work.
        if self._transforms.time < 0.0:
            return Decision(None, self._dispatcher.progress)
        found = self._localise()  # 2
        self._scans.release_known(now)  # 3
        self._update_costmaps(now)  # 4 and 5
        self._planner.step(now)  # 6
        # A trajectory is shown at the instant it was chosen, not again at those between.
        self._controller.trajectory = None
        self._move_base.step(now)  # 7
        self._dispatch(now)  # 8
        return self._decide(now, found)

    def _localise(self) -> AmclPose | None:
        """Give AMCL the scans whose odometry is known by now, broadcast its correction."""
        found = None
        known = self._transforms.time + TIME_TOLERANCE
        while self._unprocessed_scans and self._unprocessed_scans[0].time <= known:
            scan = self._unprocessed_scans.popleft()
            if scan.laser not in self._wiring.amcl:
                continue
            odom = self._transforms.base_at(scan.time)
            published = self._amcl.scan(scan.time, scan.ranges, odom, scan.laser)
            if published is not None:
                found, self._pose = published, published.pose
            # Nothing is broadcast before the first publication, afterwards at every scan.
            self._broadcasts = self._broadcasts or published is not None
            if self._broadcasts:
                self._transforms.correct(scan.time, self._amcl.map_to_odom)
        return found

    def _update_costmaps(self, now: float) -> None:
        if self._global_timer.due(now):
            self._global.update()
        if self._local_timer.due(now):
            self._local.update()

    def _dispatch(self, now: float) -> None:
        self._collect_log()
        result = self._move_base.take_result()
        if result is None and self._dispatcher.is_waiting:
            return
        before = self._dispatcher.progress
        goal = self._dispatcher.step(now, result, self._pose)
        after = self._dispatcher.progress
        if result == "succeeded":
            self._events.append(f"waypoint {after.reached} reached")
        if after.state != before.state:
            self._events.append(f"mission {after.state}")
        if goal is not None:
            number = after.reached + 1
            self._events.append(f"goal {number} sent: {goal.x:.2f}, {goal.y:.2f}, {goal.yaw:.2f}")
            # In odom the goal is put where it is now, and stays there (``goalToGlobalFrame``).
            self._move_base.accept(now, self._global.frame.take(goal))
            self._collect_log()

    def _collect_log(self) -> None:
        if self._status.log:
            self._events += self._status.log
            self._status.log.clear()

    def _decide(self, now: float, found: AmclPose | None) -> Decision:
        estimate: Estimate | None
        cloud: Cloud | None = None
        particles = None
        transforms, wide = self._transforms, self._global.frame
        if found is not None:
            estimate, cloud = self._estimates.record_published(found)
            particles = self._estimates.record_particles(now, self._amcl.particles)
        else:
            estimate = self._estimates.record_dead_reckoned(
                transforms.time, transforms.map_to_odom, transforms.odom_to_base
            )
        plan_frame = None if wide.name == "map" else wide.in_map
        plan = self._plans.take(now, self._status.plan, plan_frame)
        local_plan = self._local_plans.take(
            now, self._controller.trajectory, self._local.frame.in_map
        )
        costmap = self._costmaps.take(now, self._local.costmap.grid)
        command, progress = self._move_base.take_command(), self._dispatcher.progress
        # Cloud and particles come with an estimate.
        if (
            command is None
            and estimate is None
            and plan is None
            and local_plan is None
            and costmap is None
            and not self._events
        ):
            # Between two control cycles, mostly.
            if self._idle is None or self._idle.progress is not progress:
                self._idle = Decision(None, progress)
            return self._idle
        events, self._events = tuple(self._events), []
        return Decision(
            command, progress, estimate, cloud, plan, local_plan, events, particles, costmap
        )


def _make_global_planner(parameters: GlobalPlannerChoice, quirks: Quirks) -> Navfn | GlobalPlanner:
    """Return the global planner that ``parameters`` are of."""
    if isinstance(parameters, GlobalPlannerParameters):
        return GlobalPlanner(parameters, quirks)
    return Navfn(parameters, quirks)


def _make_local_planner(
    parameters: LocalPlannerChoice,
    quirks: Quirks,
    footprint: Floats,
    control_period: float,
    *,
    latch_goal: bool,
) -> Dwa | TrajectoryPlanner:
    """Return the controller that ``parameters`` are of.

    ``footprint`` (k, 2) [m] is padded; ``latch_goal`` is what move_base's own namespace says.
    """
    if isinstance(parameters, TrajectoryPlannerParameters):
        return TrajectoryPlanner(parameters, quirks, footprint, control_period)
    return Dwa(parameters, quirks, footprint, control_period, latch_goal=latch_goal)


def _clears_square(parameters: RosParameters) -> bool:
    """Tell whether make_plan sets a square around the robot free first."""
    quirk = parameters.quirks.dispatcher_clears_square
    return quirk and parameters.move_base.make_plan_clear_costmap


def _longest_kept(parameters: RosParameters) -> float:
    """Return how long any source of either costmap wants scans to count [s]."""
    costmaps = (parameters.global_costmap, parameters.local_costmap)
    sources = [source for costmap in costmaps for source in laser_sources(costmap)]
    return max((source.observation_persistence for source in sources), default=0.0)


def _start_covariance(parameters: AmclParameters) -> Floats:
    """Return the spread (3, 3) of the particles AMCL begins with."""
    return np.diag(
        (parameters.initial_cov_xx, parameters.initial_cov_yy, parameters.initial_cov_aa)
    )


class RosStack:
    """The ROS navigation stack; fulfils ``daemon.model.sut.SystemUnderTest``."""

    def __init__(self, parameters: RosParameters) -> None:
        self.parameters = parameters
        self._period = common_step(
            parameters.move_base.controller_frequency, parameters.rotate_recovery.frequency
        )
        self._navigation: Navigation | None = None

    @property
    def period(self) -> float:
        """Seconds of simulated time between two updates."""
        return self._period

    @property
    def needs_ground_truth(self) -> bool:
        """It localises itself."""
        return False

    def start(self, briefing: Briefing) -> None:
        """Bring the nodes up; raises ``ValueError`` for parameters that do not fit the map."""
        self._navigation = Navigation(briefing, self.parameters)

    def update(self, observation: Observation) -> Decision:
        """Decide; raises ``RuntimeError`` before ``start``."""
        if self._navigation is None:
            raise RuntimeError("the ROS stack was not started")
        return self._navigation.update(observation)


def common_step(*frequencies: float) -> float:
    """Return the longest step [s], a whole number of ticks, that fits all ``frequencies`` [Hz].

    One tick if there is none.
    """
    ticks = [TICK_RATE / frequency for frequency in frequencies]
    if any(abs(tick - round(tick)) > 1e-6 for tick in ticks):
        return 1.0 / TICK_RATE
    return math.gcd(*(round(tick) for tick in ticks)) / TICK_RATE


def warm_up() -> None:
    """Warm up what is recorded; the components are rooms of their own, of which a stack has some
    (:mod:`daemon.model.kernel_rooms`).
    """
    log = PlanRecorder()
    log.take(0.0, np.zeros((2, 3)))
    log.take(9.0, np.zeros((2, 3)))
    LocalPlanRecorder().take(0.0, np.zeros((2, 2)), Pose2())
