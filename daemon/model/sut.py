"""Protocol of a system under test: observations in, command and telemetry out.

A system under test never sees the simulator. It gets the data of a robot (a map, a mission,
odometry, laser scans) in lock step with simulated time, and answers with a velocity command and
telemetry to record. The same protocol fits a follower of a few lines and the whole ROS navigation
stack. Frames per REP 105: ``map``, ``odom``, ``base_link``.
"""

from __future__ import annotations

import re
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Final, Literal, Protocol, TypeAlias, runtime_checkable

import numpy as np
import numpy.typing as npt

from grammars.model.geometry import Floats, Pose2, Twist2
from grammars.model.grid import OccupancyGrid
from grammars.model.mission import Mission
from grammars.model.robot import Robot

TICK_RATE: Final = 100
"""Steps of the simulation per simulated second; periodic events happen at one of them."""

CollisionAction: TypeAlias = Literal["none", "stop", "slowdown", "approach", "limit"]
_RECOVERY: Final = re.compile(
    r"(Spin|BackUp|Wait|DriveOnHeading|AssistedTeleop)([-_ \d].*)?|Clear\w*Costmap.*"
)


# Plain values and arrays, no callbacks: a run then depends only on the order of its ticks.
# ``eq=False`` where arrays make comparing meaningless.
@dataclass(frozen=True, slots=True, eq=False)
class Briefing:
    """Data for a system under test before it starts.

    ``start`` is the initial pose it gets (map frame); ``seed`` feeds all its random numbers.
    """

    robot: Robot
    map: OccupancyGrid
    mission: Mission
    start: Pose2
    seed: np.random.SeedSequence


@dataclass(frozen=True, slots=True)
class Odometry:
    """A wheel odometry sample: ``pose`` of base_link in odom, ``twist`` in base_link."""

    time: float
    pose: Pose2
    twist: Twist2


@dataclass(frozen=True, slots=True, eq=False)
class LaserScan:
    """One sweep, taken at one instant: ``ranges`` [m] of shape (rays,), float32.

    ``inf`` means no return within range, ``nan`` a lost ray (REP 117). ``laser`` is the name of the
    laser, empty for the only one of a robot whose laser has none.
    """

    time: float
    ranges: npt.NDArray[np.float32]
    laser: str = ""


@dataclass(frozen=True, slots=True, eq=False)
class Observation:
    """Everything new since the previous update, oldest first; ``time`` is now [s].

    Scans of one instant are in the order of the robot's lasers.

    ``ground_truth`` is only given to systems that ask for it (``needs_ground_truth``).
    """

    time: float
    odometry: tuple[Odometry, ...]
    scans: tuple[LaserScan, ...]
    ground_truth: Pose2 | None = None


@dataclass(frozen=True, slots=True, eq=False)
class Estimate:
    """A pose estimate in the map frame; ``covariance`` (3, 3) over x, y, yaw [m, m, rad]."""

    time: float
    pose: Pose2
    covariance: Floats


@dataclass(frozen=True, slots=True, eq=False)
class Cloud:
    """Summary of a particle cloud: ``count``, mean pose and (3, 3) covariance of all particles."""

    time: float
    count: int
    mean: Pose2
    covariance: Floats


@dataclass(frozen=True, slots=True, eq=False)
class CostmapPicture:
    """A costmap at ``time``, for viewers only: it is never judged.

    ``cells`` of shape (rows, columns), uint8, row 0 at the bottom, are costs of costmap_2d: 0 free,
    253 inscribed, 254 lethal, 255 unknown. ``x``, ``y`` is the lower left corner in ``frame`` [m],
    ``resolution`` in m. ``frame_pose`` is that frame in the map, if the system knows it.
    """

    time: float
    frame: Literal["map", "odom"]
    resolution: float
    x: float
    y: float
    cells: npt.NDArray[np.uint8]
    scope: Literal["local", "global"] = "local"
    frame_pose: Pose2 | None = None


@dataclass(frozen=True, slots=True)
class TreeChange:
    """A change of a node's status, such as IDLE to RUNNING; ``uid`` identifies nodes of one name.

    ``uid`` is 0 in the messages of distributions before Jazzy.
    """

    node: str
    uid: int
    previous: str
    current: str

    @property
    def starts_recovery(self) -> bool:
        """True if a recovery of Nav2 begins: its node, recognised by name, leaves IDLE.

        Any other status counts: a service that answers at once goes from IDLE to SUCCESS.
        """
        return self.previous == "IDLE" and _RECOVERY.fullmatch(self.node) is not None


@dataclass(frozen=True, slots=True)
class BehaviorTreeLog:
    """Changes of nodes within one tick of a behaviour tree, in their order, at ``time`` [s]."""

    time: float
    changes: tuple[TreeChange, ...]


@dataclass(frozen=True, slots=True)
class CollisionMonitorState:
    """Intervention of a collision monitor from ``time`` [s] on, because of ``polygon``."""

    time: float
    action: CollisionAction
    polygon: str

    @property
    def text(self) -> str:
        """The intervention in words, empty for none."""
        return "" if self.action == "none" else f"{self.action} by {self.polygon}"


@dataclass(frozen=True, slots=True)
class SpeedLimit:
    """Speed limit from ``time`` [s] on: ``limit`` in m/s, or in % of the largest; 0 for none."""

    time: float
    limit: float
    percentage: bool

    @property
    def text(self) -> str:
        """The limit with its unit, empty for none."""
        return f"{self.limit:g} {'%' if self.percentage else 'm/s'}" if self.limit else ""


StackReport: TypeAlias = BehaviorTreeLog | CollisionMonitorState | SpeedLimit | CostmapPicture


@dataclass(frozen=True, slots=True)
class Progress:
    """Progress of the mission: ``current`` is the index of the waypoint being approached.

    ``reached`` counts completed waypoints; after the last one ``state`` is ``succeeded``.
    """

    current: int
    reached: int
    state: Literal["active", "succeeded", "aborted"]


@dataclass(frozen=True, slots=True)
class SutEvent:
    """A sentence for the log of the run, from a part of a system, such as a node."""

    text: str
    level: Literal["debug", "info", "warn", "error", "fatal"] = "info"
    source: str = "sut"


@dataclass(frozen=True, slots=True, eq=False)
class Decision:
    """Answer to one observation; ``None`` fields mean "nothing new".

    ``command`` is a body-frame velocity. ``plan`` and ``local_plan`` have shape (n, 2) in the map
    frame. ``events`` are short sentences for the log of the run; a plain text is of level info.
    ``latency`` is the wall time [s] of an answer from outside of this process, if one was due; it
    is recorded for runs that are not repeatable.

    For viewers alone, recorded at most once a second: ``particles`` (n, 3) of x, y, yaw in the
    map frame, already thinned to a hundred or so, at the time of ``cloud`` if there is one; and a
    picture of a ``costmap``.

    ``reports`` are those requested by ``record`` (:mod:`daemon.model.stack_reports`).
    """

    command: Twist2 | None
    progress: Progress
    estimate: Estimate | None = None
    cloud: Cloud | None = None
    plan: Floats | None = None
    local_plan: Floats | None = None
    events: tuple[str | SutEvent, ...] = ()
    particles: Floats | None = None
    costmap: CostmapPicture | None = None
    latency: float | None = None
    reports: tuple[StackReport, ...] = ()


class SutFailure(Exception):  # noqa: N818  (not an error of ours: how a run ended)
    """The system under test itself failed, not the robot, so the run cannot go on.

    ``reason`` is for people; ``printed`` has the relevant and the last lines of its programs.
    Together they are the message, which becomes the note of the run. ``events`` are sentences for
    the log of the run that no decision carries any more. Any other exception also ends a run, but
    is reported as a crash with its place in the code.
    """

    events: tuple[SutEvent, ...] = ()

    def __init__(
        self, reason: str, *, printed: Sequence[str] = (), events: Sequence[SutEvent] = ()
    ) -> None:
        lines = [reason, *(["the stack printed:"] if printed else ()), *(f"  {p}" for p in printed)]
        super().__init__("\n".join(lines))
        self.reason, self.printed, self.events = reason, tuple(printed), tuple(events)


class SystemUnderTest(Protocol):
    """A system under test. ``period`` [s] is a multiple of 0.01; ``update`` runs every period."""

    @property
    def period(self) -> float:
        """Seconds of simulated time between two updates."""

    @property
    def needs_ground_truth(self) -> bool:
        """True if observations must carry the true pose (only for baselines that say so)."""

    def start(self, briefing: Briefing) -> None:
        """Prepare for one run; called once, before the first update."""

    def update(self, observation: Observation) -> Decision:
        """Take new data and answer; called every ``period``."""


@runtime_checkable
class ExternalSystem(SystemUnderTest, Protocol):
    """A system under test outside of this process, which must be started and ended.

    Order of calls: ``start``, ``bring_up`` once, ``update`` every period, ``finish`` when the
    run ended without a failure, then always ``close`` and last ``outputs``.
    """

    def bring_up(self, first: Observation) -> Iterator[str]:
        """Wait until it is ready for its mission; simulated time stands still.

        ``first`` is the observation of the first ``update``. Yields, several times a second, a text
        about what it waits for, which is not recorded. Raises :class:`SutFailure`.
        """

    def finish(self) -> None:
        """Raise :class:`SutFailure` if this run must not be judged."""

    def close(self) -> None:
        """End all its processes; called once in every case."""

    def outputs(self) -> Mapping[str, bytes]:
        """Return its output by name (``stdout.txt``), bounded; attached to the trace."""
