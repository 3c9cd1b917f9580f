"""One run of the pilot: waypoints in order, waiting, replanning, getting free, giving up."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Final, Literal

from daemon.model.sut import Briefing, Decision, Observation, Progress
from daemon.stacks.pilot import motion
from daemon.stacks.pilot._parameters import PilotParameters
from daemon.stacks.pilot.localisation import Sensing
from daemon.stacks.pilot.maps import PlannedPath, Planner, first_blocked, map_field
from grammars.model.geometry import Floats, Pose2, Twist2, wrap_angle
from grammars.model.mission import Waypoint

_SETTLED: Final = 2.0
"""A robot that stands this long may use the whole tolerance, before that half of it [s]."""
_WATCHED: Final = 4.0
"""Length of the path ahead that is checked for obstacles [m]."""
_OFF_PATH: Final = 0.6
"""Distance from the path beyond which the robot plans a new one [m]."""
_CLEARANCE: Final = 0.02
"""Free space beyond the inscribed circle of the footprint [m]."""
_STUCK: Final = 4.0
"""A robot that stands this long although it wants to move is stuck [s]."""
_MAKE_ROOM: Final = 8.0
"""A robot blocked this long without another way backs off, to let a door swing [s]."""
_RETREATS: Final = 3
"""Most retreats to make room, so that the obstacle stays within sight."""
_TOO_CLOSE: Final = 0.4
"""A standing robot backs off from something that comes closer than this [m]."""
_APPROACH: Final = 0.05
"""Approach since the previous scan that counts as coming closer [m]."""
_TOUCHING: Final = 0.05
"""A standing robot backs off from something this near even if it does not move [m]."""
_LEANING: Final = 1.0
"""After standing this long, something that near leans on the robot [s]."""
_SHORTEST, _LONGEST = 0.4, 3.0
"""Shortest and longest duration of a way out [s]."""
_GAINED: Final = 1.0
"""Progress towards the waypoint that renews the patience [m]."""


@dataclass(slots=True)
class _Blockage:
    """An obstacle ``distance`` [m] ahead since ``since`` [s]; plan again at ``retry`` [s]."""

    since: float
    retry: float
    distance: float = 0.0
    announced: bool = False


class Pilot:
    """The pilot as a system under test. It localises itself."""

    period = 0.05
    needs_ground_truth = False

    def __init__(self, parameters: PilotParameters) -> None:
        self._parameters = parameters

    def start(self, briefing: Briefing) -> None:
        """Prepare the map for one run; raises ``ValueError`` for a map without free cells."""
        parameters = self._parameters
        field, hull = map_field(briefing.map), motion.hull_of(briefing.robot.footprint)
        self._waypoints = briefing.mission.waypoints
        self._limits = motion.DriveLimits(briefing.robot.drive, parameters)
        self._sensing = Sensing(briefing, field, parameters)
        self._guard = motion.CollisionGuard(hull, field, self._limits, parameters)
        self._front = float(hull.rim[:, 0].max())
        lethal = float(hull.planes[:, 2].min()) + _CLEARANCE
        preferred = max(parameters.preferred_clearance, lethal + field.resolution)
        self._planner = Planner(field, lethal, preferred, parameters.goal_tolerance)
        self._state: Literal["active", "succeeded", "aborted"] = "active"
        self._command = motion.STILL
        self._new_plan: Floats | None = None
        self._events: list[str] = []
        self._nearest = math.inf
        # Time at a standstill [s], and attempts to get free since the last progress.
        self._standing, self._attempts = 0.0, 0
        self._reached = -1
        self._stays_until = 0.0
        self._begin_waypoint()

    def _begin_waypoint(self) -> None:
        self._reached += 1
        self._pursuit: motion.Pursuit | None = None
        self._blockage: _Blockage | None = None
        self._escape, self._escapes_until = motion.STILL, 0.0
        self._turning = False
        # Waiting time since the least remaining way [s], and that way [m].
        self._waited, self._closest = 0.0, math.inf

    def update(self, observation: Observation) -> Decision:
        """Take one observation and decide."""
        self._events.clear()
        self._new_plan = None
        estimate = self._sensing.take(observation)
        pose, now = self._sensing.localiser.pose, observation.time
        target = self._target_velocity(now, pose)
        if self._state == "active":
            # Accelerations first, the guard last: it has the final word.
            ramped = self._limits.ramp(self._command, target, self.period)
            self._command = self._guard.limit(ramped, pose, self._sensing.around)
        else:
            self._command = motion.STILL
        stands = abs(self._command.vx) <= 0.03 and abs(self._command.wz) <= 0.05
        self._standing = self._standing + self.period if stands else 0.0
        # Only waiting wears patience down, not time in motion.
        self._waited += self.period if stands else 0.0
        last = max(0, len(self._waypoints) - 1)
        return Decision(
            command=self._command,
            progress=Progress(min(self._reached, last), self._reached, self._state),
            estimate=estimate,
            plan=self._new_plan,
            events=tuple(self._events),
        )

    def _target_velocity(self, now: float, pose: Pose2) -> Twist2:
        """Return the velocity to aim at, before accelerations and the guard limit it."""
        while now >= self._stays_until and self._reached < len(self._waypoints):
            goal = self._waypoints[self._reached]
            if not self._is_reached(pose, goal):
                return self._towards(now, pose, goal)
            self._events.append(f"waypoint {self._reached + 1} reached")
            self._stays_until = now + goal.wait
            self._begin_waypoint()
        if now < self._stays_until:
            # Staying is neither standing in a jam nor waiting for a way.
            self._standing, self._waited = 0.0, 0.0
            return motion.STILL
        self._state = "succeeded"
        self._events.append("mission complete")
        return motion.STILL

    def _is_reached(self, pose: Pose2, goal: Waypoint) -> bool:
        """Tell whether the robot is there: first by position, then by heading if any."""
        share = 1.0 if self._standing >= _SETTLED else 0.5
        away = math.hypot(goal.x - pose.x, goal.y - pose.y) / self._parameters.goal_tolerance
        self._turning = away <= (1.5 if self._turning else share)
        if not self._turning or goal.yaw is None:
            return self._turning
        return abs(wrap_angle(goal.yaw - pose.yaw)) <= share * self._parameters.yaw_tolerance

    def _towards(self, now: float, pose: Pose2, goal: Waypoint) -> Twist2:
        # Getting free comes first: a robot that cannot move has no use for a path.
        if now >= self._escapes_until:
            self._get_free_if_needed(now, pose)
        if now < self._escapes_until or self._state != "active":
            return self._escape
        if self._turning and goal.yaw is not None:
            return Twist2(0.0, 0.0, self._limits.towards(wrap_angle(goal.yaw - pose.yaw)))
        pursuit = self._pursuit or self._find_way(pose, goal)
        if pursuit is None:
            return motion.STILL
        if pursuit.locate(pose) > _OFF_PATH:
            self._pursuit = None
            return motion.STILL
        if pursuit.remaining < self._closest - _GAINED:
            self._waited, self._attempts, self._closest = 0.0, 0, pursuit.remaining
        self._watch(now, pose, goal, pursuit)
        if self._pursuit is not pursuit:
            return motion.STILL
        target = pursuit.steer(pose, self._command.vx)
        if self._blockage is None:
            return target
        if self._attempts:
            return motion.STILL
        room = self._blockage.distance - self._front - self._parameters.blocked_distance
        allowed = motion.stoppable(room, self._limits.acceleration)
        return motion.scaled(target, allowed / target.vx) if target.vx > allowed else target

    def _find_way(self, pose: Pose2, goal: Waypoint) -> motion.Pursuit | None:
        """Plan to ``goal`` around the known obstacles, or by the map alone if they leave no way."""
        path = self._plan_around(pose, goal)
        path = path or self._planner.plan((pose.x, pose.y), (goal.x, goal.y))
        if path is None:
            self._give_up(f"no way to waypoint {self._reached + 1}")
            return None
        return self._take(path)

    def _plan_around(self, pose: Pose2, goal: Waypoint) -> PlannedPath | None:
        clearance = self._sensing.obstacles.clearance(self._planner.preferred)
        return self._planner.plan((pose.x, pose.y), (goal.x, goal.y), clearance)

    def _take(self, path: PlannedPath) -> motion.Pursuit:
        self._pursuit = motion.Pursuit(path, self._limits, self._parameters.lookahead)
        self._new_plan = path.points
        self._standing = 0.0
        return self._pursuit

    def _watch(self, now: float, pose: Pose2, goal: Waypoint, pursuit: motion.Pursuit) -> None:
        """Look for obstacles on the path ahead; wait, or take another way."""
        points, spacing = pursuit.path
        # Things beside the robot are not obstacles ahead; the guard minds them.
        begin = pursuit.index + round(self._planner.lethal / spacing)
        ahead = points[begin : pursuit.index + round(_WATCHED / spacing)]
        hit = first_blocked(ahead, self._sensing.obstacles.centres, self._planner.lethal)
        wait = self._parameters.wait_before_replanning
        if hit < 0:
            if self._blockage is not None and self._blockage.announced:
                self._events.append("the way is free again")
                self._standing = 0.0
            self._blockage = None
            return
        blockage = self._blockage = self._blockage or _Blockage(now, now + wait)
        blockage.distance = (begin + hit - pursuit.index) * spacing
        if now < blockage.retry:
            return
        path = self._plan_around(pose, goal)
        if path is not None:
            self._events.append("replanning around an obstacle")
            self._blockage = None
            self._take(path)
            return
        blockage.retry = now + max(wait, now - blockage.since)
        if not blockage.announced:
            blockage.announced = True
            self._events.append("blocked, waiting")

    def _get_free_if_needed(self, now: float, pose: Pose2) -> None:
        """Start a way out if something comes close, leans on the robot or holds it.

        Give up when the patience ends.
        """
        previous, self._nearest = self._nearest, self._guard.nearest
        blocked = self._blockage is not None
        may_try = self._attempts < self._parameters.recoveries
        comes = self._standing > 0.0 and self._nearest < min(_TOO_CLOSE, previous - _APPROACH)
        leans = self._standing > _LEANING and self._nearest < _TOUCHING and may_try
        if self._waited >= self._parameters.patience:
            why = "no way to" if blocked else "stuck on the way to"
            self._give_up(f"{why} waypoint {self._reached + 1}")
        elif comes or leans:
            self._start_escape(now, pose, "something comes close, {}", hurry=2.0)
        elif self._blockage is not None and self._blockage.announced:
            room_at = self._blockage.since + (1 + self._attempts) * _MAKE_ROOM
            if now >= room_at and self._attempts < min(_RETREATS, self._parameters.recoveries):
                self._start_escape(now, pose, "blocked, {} to make room", turns=False)
        elif may_try and not blocked and self._standing > _STUCK:
            self._start_escape(now, pose, "stuck, {}")

    def _start_escape(
        self, now: float, pose: Pose2, words: str, *, hurry: float = 1.0, turns: bool = True
    ) -> None:
        """Start the motion that stays free longest, if any; backing off wins a tie."""
        longest = _SHORTEST
        for name, usual in motion.ESCAPES if turns else motion.ESCAPES[:1]:
            command = motion.scaled(usual, hurry)
            free = self._guard.free(command, pose, self._sensing.around, _LONGEST)
            if free > longest:
                longest, best = free, name
                self._escape, self._escapes_until = command, now + free
        if longest > _SHORTEST:
            self._attempts += 1
            self._pursuit = None
            self._events.append(words.format(best))

    def _give_up(self, why: str) -> None:
        self._state = "aborted"
        self._events.append(f"giving up: {why}")
