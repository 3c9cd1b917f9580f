"""One run of the pilot: waypoints in order, waiting, replanning, getting free, giving up.

Besides the driver two checkers that it asks at every update: whether a waypoint is reached, and
whether the robot gets anywhere.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Final, Literal

from daemon.model.sut import Briefing, Decision, Observation, Progress
from daemon.stacks.pilot._parameters import PilotParameters
from daemon.stacks.pilot._sensing import Sensing
from daemon.stacks.pilot.guard import STILL, CollisionGuard, EscapeMotion, find_escape, half_planes
from daemon.stacks.pilot.map_field import MapField, map_field
from daemon.stacks.pilot.planner import SPACING, PlannedPath, Planner
from daemon.stacks.pilot.pursuit import DriveLimits, Pursuit
from grammars.model.geometry import Floats, Pose2, Twist2, wrap_angle
from grammars.model.mission import Waypoint

_SETTLING: Final = 2.0
"""Within tolerance for this long counts as there, even if it could come closer [s]."""


class GoalChecker:
    """Watches one waypoint: first the position, then the heading if it has one.

    The robot drives on to half the tolerance, so that the error of its localisation has room;
    if it comes no closer within two seconds, the tolerance itself is enough.

    Attributes:
        turning: the position is reached, the heading is not yet.
    """

    def __init__(self, goal_tolerance: float, yaw_tolerance: float) -> None:
        self._goal_tolerance, self._yaw_tolerance = goal_tolerance, yaw_tolerance
        self._since: float | None = None
        self.turning = False

    def reset(self) -> None:
        """Begin with the next waypoint."""
        self.turning, self._since = False, None

    def check(self, now: float, pose: Pose2, goal: Waypoint) -> bool:
        """Tell whether ``goal`` is reached at ``pose``."""
        away = math.hypot(goal.x - pose.x, goal.y - pose.y)
        if away > self._goal_tolerance * (1.5 if self.turning else 1.0):
            self.reset()
            return False
        if self._since is None:
            self._since = now
        settled = now - self._since >= _SETTLING
        if not (self.turning or settled or away <= 0.5 * self._goal_tolerance):
            return False
        if goal.yaw is None:
            return True
        if not self.turning:
            self.turning, self._since, settled = True, now, False
        error = abs(wrap_angle(goal.yaw - pose.yaw))
        return error <= (1.0 if settled else 0.5) * self._yaw_tolerance


_STUCK: Final = 4.0
"""Standing for this long, a robot that wants to move is stuck [s]."""
_MOVED: Final = 0.1
_TURNED: Final = 0.2
"""Less motion than this counts as standing [m, rad]."""
_FAR_FROM_STUCK: Final = 1.5
"""So far from where it was stuck, the count of attempts starts anew [m]."""


class ProgressChecker:
    """Remembers when and where the robot last moved.

    Attributes:
        attempts: how often it tried to get free around here.
    """

    def __init__(self, start: Pose2) -> None:
        self._at, self._time = start, 0.0
        self._stuck_at = start
        self.attempts = 0

    def restart(self, now: float, pose: Pose2) -> None:
        """Count from now: it moved, or stands for a reason."""
        self._at, self._time = pose, now

    def note_attempt(self, pose: Pose2) -> None:
        """Count an attempt to get free."""
        if self.attempts == 0:
            self._stuck_at = pose
        self.attempts += 1

    def standing(self, now: float) -> float:
        """Return for how long it has not moved [s]."""
        return now - self._time

    def is_stuck(self, now: float, pose: Pose2) -> bool:
        """Take the pose at ``now`` and tell whether the robot is stuck."""
        away = math.hypot(pose.x - self._at.x, pose.y - self._at.y)
        if away > _MOVED or abs(wrap_angle(pose.yaw - self._at.yaw)) > _TURNED:
            self.restart(now, pose)
        far = math.hypot(pose.x - self._stuck_at.x, pose.y - self._stuck_at.y) > _FAR_FROM_STUCK
        if self.attempts and far:
            self.attempts = 0
        return self.standing(now) > _STUCK


_WATCHED: Final = 4.0
"""How much of the path ahead is watched for obstacles [m]."""
_OFF_PATH: Final = 0.6
"""Farther than this from its path the robot plans a new one [m]."""
_FIRST_RETRY: Final = 2.0
_LAST_RETRY: Final = 15.0
"""Seconds between two attempts to plan around an obstacle, doubling from first to last."""
_TOO_CLOSE: Final = 0.4
"""From something that comes closer than this the standing robot backs off [m]."""
_APPROACH: Final = 0.05
"""How much closer it must have come since the previous scan [m]."""
_TOUCHING: Final = 0.05
"""From something this near the blocked robot backs off even if it does not move [m]."""
_LEANING: Final = 1.0
"""So long it stands still before it takes something that near for leaning on it [s]."""
_MAKE_ROOM: Final = 8.0
"""Blocked for so long without another way, the robot backs off, for a door to swing [s]."""
_RETREATS: Final = 3
"""How often it does so before one obstacle; it stays within sight of it."""
_BACKING: Final = 4.0
"""How long it backs off to make room, at most [s]."""
_GAINED: Final = 1.0
"""Coming this much closer to the waypoint renews the patience [m]."""


@dataclass(slots=True)
class _Blockage:
    """The way is blocked since ``since`` [s]; ``distance`` [m] ahead on the path."""

    since: float
    retry: float
    distance: float = 0.0
    pause: float = _FIRST_RETRY
    announced: bool = False
    retreats: int = 0


class Driver:
    """Drives one mission; ``update`` is called every ``period`` seconds."""

    def __init__(self, briefing: Briefing, parameters: PilotParameters, period: float) -> None:
        robot = briefing.robot
        field: MapField = map_field(briefing.map)
        self._parameters, self._period = parameters, period
        self._waypoints = briefing.mission.waypoints
        self._limits = DriveLimits.of(robot.drive, parameters)
        self._sensing = Sensing(briefing, field, parameters)
        self._guard = CollisionGuard(robot, field, self._limits, parameters)
        inscribed = float(half_planes(robot.footprint)[:, 2].min())
        lethal = inscribed + parameters.clearance_margin
        self._planner = Planner(
            field,
            lethal=lethal,
            preferred=max(parameters.preferred_clearance, lethal + field.resolution),
            weight=parameters.clearance_weight,
            tolerance=parameters.goal_tolerance,
        )
        self._reached = 0
        self._state: Literal["active", "succeeded", "aborted"] = "active"
        self._command = STILL
        self._pursuit: Pursuit | None = None
        self._new_plan: Floats | None = None
        self._blockage: _Blockage | None = None
        self._waited, self._watched, self._closest = 0.0, 0.0, math.inf
        self._escape: EscapeMotion | None = None
        self._nearest = math.inf
        self._arrival = GoalChecker(parameters.goal_tolerance, parameters.yaw_tolerance)
        self._motion = ProgressChecker(briefing.start)
        self._events: list[str] = []

    def update(self, observation: Observation) -> Decision:
        """Take one observation and decide."""
        self._events.clear()
        self._new_plan = None
        estimate = self._sensing.take(observation)
        pose, now = self._sensing.pose, observation.time
        wanted = self._wanted_velocity(now, pose, scanned=bool(observation.scans))
        if self._state == "active":
            # Accelerations first, the guard last: what it allows is what is sent.
            ramped = self._guard.ramp(self._command, wanted, self._period)
            self._command = self._guard.limit(ramped, pose, self._sensing.around)
        else:
            self._command = STILL
        return Decision(
            command=self._command,
            progress=self._progress(),
            estimate=estimate,
            plan=self._new_plan,
            events=tuple(self._events),
        )

    def _progress(self) -> Progress:
        last = max(0, len(self._waypoints) - 1)
        return Progress(min(self._reached, last), self._reached, self._state)

    def _wanted_velocity(self, now: float, pose: Pose2, *, scanned: bool) -> Twist2:
        """Return the velocity wanted now, before accelerations and the guard have their say."""
        while self._state == "active":
            if self._reached == len(self._waypoints):
                self._state = "succeeded"
                self._log("mission complete")
                break
            if not self._arrival.check(now, pose, self._waypoints[self._reached]):
                return self._towards(now, pose, self._waypoints[self._reached], scanned)
            self._reached += 1
            self._log(f"waypoint {self._reached} reached")
            self._leave_waypoint(now, pose)
        return STILL

    def _leave_waypoint(self, now: float, pose: Pose2) -> None:
        self._pursuit = self._blockage = self._escape = None
        self._arrival.reset()
        self._waited, self._watched, self._closest = 0.0, now, math.inf
        self._motion.restart(now, pose)

    def _towards(self, now: float, pose: Pose2, goal: Waypoint, scanned: bool) -> Twist2:
        if self._escape is not None and now >= self._escape.until:
            self._escape, self._pursuit = None, None
            self._motion.restart(now, pose)
        # Getting free goes before everything: a path is of no use to a robot that cannot move.
        if self._escape is None:
            self._start_escape_if_needed(now, pose, scanned)
        if self._escape is not None:
            # Patience is for waiting: what passes in motion does not count.
            self._watched = now
            return self._escape.command
        if self._arrival.turning and goal.yaw is not None and self._pursuit is not None:
            return self._pursuit.turn_to(pose, goal.yaw)
        pursuit = self._pursuit or self._find_way(now, pose, goal)
        if pursuit is None:
            return STILL
        if pursuit.locate(pose) > _OFF_PATH:
            self._pursuit = None
            return STILL
        if scanned:
            self._watch(now, pose, goal, pursuit)
        return self._follow(pose, self._pursuit)

    def _start_escape_if_needed(self, now: float, pose: Pose2, scanned: bool) -> None:
        """Start an escape when something comes close, leans on the robot or holds it."""
        if scanned and self._is_approached(now) and self._back_away(now, pose):
            return
        if self._blockage is not None:
            self._motion.restart(now, pose)
        if self._motion.is_stuck(now, pose):
            self._get_free(now, pose)

    def _follow(self, pose: Pose2, pursuit: Pursuit | None) -> Twist2:
        if pursuit is None or self._state != "active":
            return STILL
        speed = math.hypot(self._command.vx, self._command.vy)
        wanted = pursuit.steer(pose, speed)
        if self._blockage is None:
            return wanted
        if self._blockage.retreats > 0:
            return STILL
        # A door needs room to swing: stop well before what blocks the way.
        room = self._blockage.distance - self._guard.front - self._parameters.blocked_distance
        allowed = math.sqrt(2.0 * self._limits.acceleration * max(0.0, room))
        fast = math.hypot(wanted.vx, wanted.vy)
        if fast <= allowed:
            return wanted
        scale = allowed / fast
        return Twist2(wanted.vx * scale, wanted.vy * scale, wanted.wz * scale)

    def _find_way(self, now: float, pose: Pose2, goal: Waypoint) -> Pursuit | None:
        """Plan to ``goal`` around what is known to be in the way, else as the map says."""
        path = self._plan(pose, goal, around_obstacles=True)
        if path is None and self._sensing.obstacles.count:
            path = self._plan(pose, goal, around_obstacles=False)
        if path is None:
            self._give_up(f"no way to waypoint {self._reached + 1}")
            return None
        return self._take(now, pose, path)

    def _plan(self, pose: Pose2, goal: Waypoint, *, around_obstacles: bool) -> PlannedPath | None:
        planner = self._planner
        clearance = None
        if around_obstacles and self._sensing.obstacles.count:
            clearance = self._sensing.obstacles.clearance(planner.preferred)
        return planner.plan((pose.x, pose.y), (goal.x, goal.y), clearance)

    def _take(self, now: float, pose: Pose2, path: PlannedPath) -> Pursuit:
        self._pursuit = Pursuit(path, self._limits, self._parameters)
        self._new_plan = path.points
        self._motion.restart(now, pose)
        return self._pursuit

    def _watch(self, now: float, pose: Pose2, goal: Waypoint, pursuit: Pursuit) -> None:
        """Look for obstacles on the path ahead; wait, replan or give up."""
        points = pursuit.path.points
        lethal = self._planner.lethal
        # What is beside the robot now is no obstacle ahead; the guard minds it.
        begin = pursuit.index + round(lethal / SPACING)
        end = min(len(points), pursuit.index + round(_WATCHED / SPACING))
        hit = self._sensing.obstacles.first_blocked(points, begin, end, lethal)
        if hit < 0:
            if self._blockage is not None and self._blockage.announced:
                self._log("the way is free again")
                self._motion.restart(now, pose)
            self._blockage = None
            self._watched = now
            return
        wait = self._parameters.wait_before_replanning
        if self._blockage is None:
            self._blockage = _Blockage(since=now, retry=now + wait)
        blockage = self._blockage
        travelled = pursuit.path.travelled
        blockage.distance = float(travelled[hit] - travelled[pursuit.index])
        if self._patience_ends(now, pursuit.remaining):
            self._give_up(f"no way to waypoint {self._reached + 1}")
        elif now >= blockage.retry:
            self._replan(now, pose, goal, blockage)
        elif blockage.announced and now >= blockage.since + (1 + blockage.retreats) * _MAKE_ROOM:
            self._make_room(now, pose, blockage)

    def _patience_ends(self, now: float, remaining: float) -> bool:
        """Count the time it waited, blocked, since it last came closer to the waypoint."""
        if remaining < self._closest - _GAINED:
            self._waited, self._closest = 0.0, remaining
        self._waited += now - self._watched
        self._watched = now
        return self._waited >= self._parameters.patience

    def _make_room(self, now: float, pose: Pose2, blockage: _Blockage) -> None:
        """Back off a little from what blocks the way, a few times."""
        if blockage.retreats >= _RETREATS:
            return
        blockage.retreats += 1
        self._escape = find_escape(
            self._guard,
            self._limits,
            pose,
            self._sensing.around,
            now,
            longest=_BACKING,
            turns=False,
        )
        if self._escape is not None:
            self._log(f"blocked, {self._escape.name} to make room")

    def _replan(self, now: float, pose: Pose2, goal: Waypoint, blockage: _Blockage) -> None:
        path = self._plan(pose, goal, around_obstacles=True)
        if path is not None:
            self._log("replanning around an obstacle")
            self._blockage = None
            self._take(now, pose, path)
            return
        blockage.retry = now + blockage.pause
        blockage.pause = min(_LAST_RETRY, 2.0 * blockage.pause)
        if not blockage.announced:
            blockage.announced = True
            self._log("blocked, waiting")

    def _is_approached(self, now: float) -> bool:
        """Tell whether something unknown comes towards the standing robot, or leans on it."""
        before, self._nearest = self._nearest, self._guard.nearest(self._sensing.around)
        command = self._command
        if math.hypot(command.vx, command.vy) > 0.03 or abs(command.wz) > 0.05:
            return False
        if self._nearest >= _TOUCHING:
            return self._nearest < min(_TOO_CLOSE, before - _APPROACH)
        if self._blockage is not None:
            return self._blockage.retreats < self._parameters.recoveries
        leaning = self._motion.standing(now) > _LEANING
        return leaning and self._motion.attempts < self._parameters.recoveries

    def _back_away(self, now: float, pose: Pose2) -> bool:
        """Start to move away from what comes close; tell whether there is a way to."""
        escape = find_escape(self._guard, self._limits, pose, self._sensing.around, now, hurry=2.0)
        if escape is None:
            return False
        if self._blockage is not None:
            self._blockage.retreats += 1
        else:
            self._motion.note_attempt(pose)
        self._escape = escape
        self._log(f"something comes close, {escape.name}")
        return True

    def _get_free(self, now: float, pose: Pose2) -> None:
        """Start a short motion out of a tight spot, or give up when patience ends."""
        if self._motion.standing(now) > self._parameters.patience:
            self._give_up(f"stuck on the way to waypoint {self._reached + 1}")
            return
        if self._motion.attempts >= self._parameters.recoveries:
            return
        escape = find_escape(self._guard, self._limits, pose, self._sensing.around, now)
        if escape is None:
            return
        self._motion.note_attempt(pose)
        self._escape = escape
        self._log(f"stuck, {escape.name}")

    def _give_up(self, why: str) -> None:
        self._state = "aborted"
        self._log(f"giving up: {why}")

    def _log(self, sentence: str) -> None:
        self._events.append(sentence)
