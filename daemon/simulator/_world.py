"""World of a run: building, objects, robot, sensors and behaviours, stepped together."""

from __future__ import annotations

import math
import zlib
from collections.abc import Sequence

import numpy as np
import numpy.typing as npt
import pymunk

from daemon.model.sut import TICK_RATE, Odometry
from daemon.simulator import _chipmunk as chipmunk
from daemon.simulator._assembly import SLEEP_TIME, BodyStates, JointReader, assemble
from daemon.simulator._behaviours import starting_positions
from daemon.simulator._building import (
    ContactLog,
    RobotContact,
    WorldEvent,
    build_walls,
    cut_at,
)
from daemon.simulator._joints import JointDrive
from daemon.simulator._mobile_base import make_base
from daemon.simulator._physics import ROBOT_COLLISION_TYPE
from daemon.simulator._scheduler import BehaviourScheduler
from daemon.simulator._sensors import LaserPlane, LaserScanner, OdometrySensor
from grammars.model.behaviour import Behaviour, Walk
from grammars.model.geometry import Floats, Pose2, Twist2
from grammars.model.robot import Robot
from grammars.model.scene import Scene


class World:
    """Simulated run at 100 ticks per second from time 0.

    Building order, random streams and stepping depend on the arguments alone. Equal arguments and
    equal calls give equal floats in any process on one kind of CPU.

    Attributes:
        tick: number of physics ticks done.
        joint_names: scene-wide joint names, the order of all joint arrays.
    """

    def __init__(
        self,
        scene: Scene,
        robot: Robot,
        start: Pose2,
        behaviours: Sequence[Behaviour],
        seed: np.random.SeedSequence,
        waypoints: Sequence[str] = (),
    ) -> None:
        """Build the world; the robot stands still at ``start``.

        ``waypoints`` are the ids of the mission, for reactions to reached waypoints.

        Raises:
            ValueError: behaviours contradict the scene or each other, joints of an object form no
                tree, a moving link has no mass, or a waypoint is not in the mission.
        """
        self.tick = 0
        self.joint_names = scene.joint_names
        # A new space for every run, filled in a fixed order: results of Chipmunk depend on the
        # order of additions and on the history of a space.
        self._space = space = _new_space()
        begin, holds = starting_positions(scene, behaviours)
        walking = [b.object for b in behaviours if isinstance(b, Walk)]
        self._assembly = assembly = assemble(space, scene, begin, holds, robot.height, walking)
        owners = build_walls(space, scene, robot.height) | assembly.owners
        self._drives = {
            motion.name: JointDrive(space, motion, assembly) for motion in assembly.motions
        }
        self._base = make_base(space, robot, start)
        self._contacts = ContactLog(space, self._base, owners)
        self._events: list[WorldEvent] = []
        self._scheduler = BehaviourScheduler(
            scene, robot, behaviours, self._drives, assembly, self._base, self._report, waypoints
        )
        self._bodies = BodyStates(space, assembly.bodies)
        self._joints = JointReader(
            self.joint_names, assembly.motions + assembly.walks, assembly.holds, assembly.bodies
        )
        self._set_up_lasers(scene, robot, seed)
        self._odometry = OdometrySensor(robot.odometry, start, _stream(seed, "odometry"))
        # These are read from the physics once a tick.
        self._pose_tick, self._pose = -1, start
        self._twist_tick, self._twist = -1, Twist2()
        # A step of zero time moves nothing, but pymunk checks that every body has a mass.
        space.step(0.0)
        self._step = chipmunk.stepper(space)
        self._between_ticks = robot.odometry.period > 0.0
        self._before = (start.x, start.y, start.yaw)

    def _set_up_lasers(self, scene: Scene, robot: Robot, seed: np.random.SeedSequence) -> None:
        planes: dict[float, LaserPlane] = {}
        self._lasers: dict[str, LaserScanner] = {}
        for laser in robot.lasers:
            # Lasers at one height share their segments.
            if laser.z not in planes:
                planes[laser.z] = cut_at(scene, self._assembly, laser.z)
            # A stream for each name: another sensor, or noise switched off, does not affect the
            # others.
            noise, dropout = (_stream(seed, f"{laser.label} {of}") for of in ("noise", "dropout"))
            self._lasers[laser.name] = LaserScanner(laser, planes[laser.z], noise, dropout)
        self._first_laser = robot.laser.name

    @property
    def time(self) -> float:
        """Simulated seconds since the start."""
        return self.tick / TICK_RATE

    def command(self, twist: Twist2) -> None:
        """Command a body-frame velocity from now on, within the limits of the drive.

        Raises:
            ValueError: a component is not finite.
        """
        self._base.command(twist, self.tick)

    def progress(self, current: int, reached: int) -> None:
        """Report the progress of the mission, to which behaviours may react.

        ``current`` is the index of the present waypoint, ``reached`` the number of reached
        waypoints. Events are never taken back.
        """
        self._scheduler.progress(current, reached, self.tick)

    def advance(self, ticks: int = 1) -> None:
        """Simulate ``ticks`` steps of 10 ms."""
        step, drive, log, scheduler = self._step, self._base.update, self._contacts, self._scheduler
        end = self.tick + ticks
        body, last = self._base.handle, end - 1 if self._between_ticks else -1
        for tick in range(self.tick, end):
            # Before the step, because Chipmunk calls the log inside of it.
            log.tick = tick
            if tick == last:
                position = chipmunk.position(body)
                self._before = (position.x, position.y, chipmunk.angle(body))
            # Doors and people act first, then the robot, then all move at once. Each sees the world
            # as recorded at this tick, never another's half-done step.
            if tick >= scheduler.due:
                self.tick = tick
                scheduler.update(tick)
            drive(tick)
            step()
        if ticks > 0:
            self.tick = end

    def close(self) -> None:
        """End the world; only its ``time`` stays valid."""
        # Chipmunk still reports ends of touches while it frees a space, perhaps after their log.
        nobody = pymunk.empty_callback
        self._space.on_collision(ROBOT_COLLISION_TYPE, None, begin=nobody, separate=nobody)

    def pose(self) -> Pose2:
        """Return the true pose of base_link in the world."""
        if self._pose_tick != self.tick:
            self._pose_tick, self._pose = self.tick, self._base.pose()
        return self._pose

    def twist(self) -> Twist2:
        """Return the true velocity of base_link in its own frame."""
        if self._twist_tick != self.tick:
            self._twist_tick, self._twist = self.tick, self._base.twist()
        return self._twist

    def joint_positions(self) -> Floats:
        """Return the joint positions [rad or m], shape (joints,), as an array that never changes.

        It is the same array until a joint moves.
        """
        return self.joint_states()[0]

    def joint_states(self) -> tuple[Floats, Floats]:
        """Return joint positions as above and velocities [rad/s or m/s] together."""
        # In this order, because reading the table sets its version.
        table = self._bodies.at(self.tick)
        return self._joints.at(table, self._bodies.version)

    def scan(self, laser: str | None = None) -> npt.NDArray[np.float32]:
        """Take one laser sweep, shape (rays,) in metres; nan, inf and -inf as in REP 117.

        ``laser`` is its name, by default that of the first laser. Raises ``KeyError`` for an
        unknown one.
        """
        table = self._bodies.at(self.tick)
        return self._scanner(laser).scan(self.pose(), table, self._bodies.version)

    def _scanner(self, laser: str | None) -> LaserScanner:
        return self._lasers[self._first_laser if laser is None else laser]

    def odometry(self, at: float | None = None) -> Odometry:
        """Take one odometry sample; its noise is for the way since the previous sample.

        ``at`` is the instant of the sample within the last tick, by default now. Only a robot
        whose odometry has a ``period`` can look back.
        """
        now = self.time
        if at is None or at >= now:
            return self._odometry.sample(now, self.pose(), self.twist)
        return self._odometry.sample(at, self._between((now - at) * TICK_RATE), self.twist)

    def _between(self, ago: float) -> Pose2:
        """Return the true pose a fraction of a tick ago, by the constant velocity of a tick."""
        x, y, yaw = self._before
        now, angle = chipmunk.position(self._base.handle), chipmunk.angle(self._base.handle)
        return Pose2(
            now.x + ago * (x - now.x),
            now.y + ago * (y - now.y),
            math.remainder(angle + ago * (yaw - angle), math.tau),
        )

    def take_contacts(self) -> tuple[RobotContact, ...]:
        """Return the robot's touches since the last call, ordered by begin and owner."""
        return self._contacts.take(self.tick)

    def take_events(self) -> tuple[WorldEvent, ...]:
        """Return the events of behaviours since the last call, in order."""
        events, self._events = tuple(self._events), []
        return events

    def _report(self, source: str, text: str) -> None:
        self._events.append(WorldEvent(self.time, source, text))


def _new_space() -> pymunk.Space:
    # Ten iterations of the solver, the default: with 30 a hinge yields just as much (1.1 mm at
    # 300 N) and a step takes twice as long.
    space = pymunk.Space()
    # Penetration without correction, so that resting contacts last. The default of 0.1 is for
    # pixels.
    space.collision_slop = 5e-4
    # Share of a penetration that Chipmunk keeps after one second: every tick removes 20 % (by
    # default a sixtieth of a second removes 10 %).
    space.collision_bias = 0.8**TICK_RATE
    # Bodies at rest are cheap: a step with 20 doors takes 11.5 us awake and 3.6 us asleep, on the
    # same trajectories. A leaf slower than 0.1 mm/s for half a second is at rest.
    space.sleep_time_threshold = SLEEP_TIME
    space.idle_speed_threshold = 1e-4
    return space


def _stream(seed: np.random.SeedSequence, name: str) -> np.random.Generator:
    """Return the random stream ``name`` below ``seed``, without changing ``seed``."""
    # ``spawn`` would count in the seed itself, but equal calls must give equal streams. ``hash``
    # would differ from process to process.
    key = (*seed.spawn_key, zlib.crc32(name.encode()))
    child = np.random.SeedSequence(entropy=seed.entropy, spawn_key=key, pool_size=seed.pool_size)
    return np.random.Generator(np.random.PCG64(child))
