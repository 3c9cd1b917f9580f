"""Launch files for ROS 1 and ROS 2: simulator, map and start pose of one world.

They find the other artefacts beside themselves, so the folder can be put anywhere, for example
into a package. The robot is one's own: a launch file named by the argument ``robot_launch`` is
included with the start pose, yaw too.
"""

from __future__ import annotations

from pathlib import Path

from grammars.values import Pose2
from templates.occupancy_files import map_file
from templates.sdf import world_file
from templates.task_files import mission_file
from templates.world import Job


def write_launch(job: Job) -> tuple[Path, ...]:
    """Write ``launch/<world>.launch`` (ROS 1) and ``launch/<world>.launch.xml`` (ROS 2)."""
    mission = job.world.mission
    start = mission.start if mission else Pose2()
    values = {
        "name": job.name,
        "map": map_file(job),
        "x": start.x,
        "y": start.y,
        "yaw": start.yaw,
        "robot": job.world.robot.name if job.world.robot else "robot",
    }
    draw = job.world.draws[0]
    ros1 = job.templates.render(
        "ros1.launch.j2",
        world=world_file(job, draw, classic=True),
        task=mission_file(job, era=True) if mission else "",
        **values,
    )
    ros2 = job.templates.render(
        "ros2.launch.xml.j2",
        world=world_file(job, draw, classic=False),
        **values,
    )
    return (
        job.write(job.path("launch", f"{job.name}.launch"), ros1),
        job.write(job.path("launch", f"{job.name}.launch.xml"), ros2),
    )
