"""What nodes of the stack ask of each other: a costmap kept up to date, a plan, a command.

Whoever asks is given one of these and never the stack as a whole. It would then be reachable from
its own parts, and all its maps would stay in memory until the next collection of garbage: with
four runs of S1 in one process its memory went from 259 to 401 MB that way.
"""

from __future__ import annotations

from collections.abc import Collection

from daemon.stacks.ros1.costmap.costmap import Costmap
from daemon.stacks.ros1.dwa import Dwa
from daemon.stacks.ros1.frames import CostmapFrame
from daemon.stacks.ros1.global_planner.planner import GlobalPlanner
from daemon.stacks.ros1.move_base import RobotPoses, TransformBuffer
from daemon.stacks.ros1.navfn.planner import Navfn
from daemon.stacks.ros1.scan_buffer import ScanBuffer
from daemon.stacks.ros1.trajectory_planner import TrajectoryPlanner
from grammars.model.geometry import Floats, Pose2, Twist2


class ObservedCostmap:
    """A costmap in its frame, which sees the scans of the lasers it has ``heard``."""

    def __init__(
        self, costmap: Costmap, frame: CostmapFrame, scans: ScanBuffer, heard: Collection[str]
    ) -> None:
        self.costmap, self.frame = costmap, frame
        self._scans, self._heard = scans, heard

    def update(self) -> None:
        """Run one update cycle with the robot and the scans where they are now."""
        frame, buffer = self.frame, self._scans
        scans = buffer.in_map() if frame.name == "map" else buffer.in_odom()
        heard = [scan for scan in scans if scan.laser in self._heard]
        self.costmap.update(frame.base, heard, frame.in_map)


class PlanMaker:
    """The global planner on the global costmap, for move_base and for the service make_plan.

    The service sets a square of ``clearing_radius`` [m] around the robot free first, or nothing.
    """

    def __init__(
        self,
        planner: Navfn | GlobalPlanner,
        global_: ObservedCostmap,
        local: ObservedCostmap,
        clearing_radius: float | None,
    ) -> None:
        self._planner, self._global, self._local = planner, global_, local
        self._clearing_radius = clearing_radius

    def plan(self, goal: Pose2) -> Floats | None:
        """Plan from where the robot is, both in the frame of the global costmap."""
        return self._planner.plan(self._global.costmap.grid, self._global.frame.base, goal)

    def robot_poses(self) -> RobotPoses:
        """Return where the base is in the frames of both costmaps."""
        return RobotPoses(self._local.frame.base, self._global.frame.base)

    def serve(self, start: Pose2, goal: Pose2) -> None:
        """Serve make_plan: nobody wants the plan, its side effects stay (``planService``)."""
        half = self._clearing_radius
        if half is not None:
            self._global.costmap.clear_square(self._global.frame.base, half)
            self._local.costmap.clear_square(self._local.frame.base, half)
        # The service passes start and goal on as they are, and planners refuse other frames.
        if self._global.frame.name == "map":
            self._planner.plan(self._global.costmap.grid, start, goal)


class LocalController:
    """The controller with what it needs to know at hand; keeps the trajectory it chose last."""

    def __init__(
        self,
        planner: Dwa | TrajectoryPlanner,
        transforms: TransformBuffer,
        local: ObservedCostmap,
        plan_frame: CostmapFrame,
    ) -> None:
        self._planner, self._transforms = planner, transforms
        self._local, self._frame = local.costmap.grid, local.frame
        self._plan_frame = plan_frame
        self.trajectory: Floats | None = None

    def set_plan(self, plan: Floats) -> None:
        """Take a new global plan (n, 3) in the frame of the global costmap."""
        self._planner.set_plan(plan)

    def goal_reached(self) -> bool:
        """Tell whether the robot is at the goal of the plan, and stands."""
        frame, twist = self._frame, self._transforms.twist
        return self._planner.goal_reached(frame.base, twist, frame.pose_in(self._plan_frame))

    def command(self) -> Twist2 | None:
        """Return a velocity command, ``None`` when there is no valid one."""
        frame, twist = self._frame, self._transforms.twist
        answer = self._planner.command(
            frame.base, twist, frame.pose_in(self._plan_frame), self._local
        )
        self.trajectory = answer.local_plan
        return answer.twist if answer.ok else None
