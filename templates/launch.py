"""Files for other tools: launch files for ROS 1 and ROS 2, and a layout for Foxglove.

Launch files refer to the other artefacts by relative paths, so the folder can be moved, for example
into a package. The argument ``robot_launch`` names the launch file of the robot, which is included
with the start pose and its yaw.
"""

from __future__ import annotations

import json
from pathlib import Path

from grammars.model.geometry import Pose2
from templates.maps import map_file
from templates.rendering import render
from templates.sdf import world_file
from templates.tasks import mission_file
from templates.world import ExportJob


def write_launch(job: ExportJob) -> tuple[Path, ...]:
    """Write ``launch/<world>.launch`` (ROS 1) and ``launch/<world>.launch.xml`` (ROS 2)."""
    mission = job.world.mission
    start = mission.start if mission else Pose2()
    # A launch file starts the world of the first draw of behaviours.
    draw = job.world.draws[0]
    values = {
        "name": job.name,
        "map": map_file(job, draw),
        "x": start.x,
        "y": start.y,
        "yaw": start.yaw,
        "robot": job.world.robot.name if job.world.robot else "robot",
    }
    ros1 = render(
        "ros1.launch.j2",
        world=world_file(job, draw, classic=True),
        task=mission_file(job, era=True) if mission else "",
        **values,
    )
    ros2 = render(
        "ros2.launch.xml.j2",
        world=world_file(job, draw, classic=False),
        **values,
    )
    return (
        job.write(job.path("launch", f"{job.name}.launch"), ros1),
        job.write(job.path("launch", f"{job.name}.launch.xml"), ros2),
    )


def write_layout(job: ExportJob) -> tuple[Path, ...]:
    """Write ``<world>.foxglove.json``: top view, localisation, speed, joints, events."""
    scene, robot = job.world.scene, job.world.robot
    corners = [corner for region in scene.regions for corner in region.outline]
    corners = corners or [corner for solid in scene.solids for corner in solid.polygon]
    xs, ys = [c[0] for c in corners] or [0.0], [c[1] for c in corners] or [0.0]
    text = render(
        "foxglove.json.j2",
        centre=((min(xs) + max(xs)) / 2.0, (min(ys) + max(ys)) / 2.0),
        extent=max(max(xs) - min(xs), max(ys) - min(ys), 1.0),
        joints=list(scene.joint_names),
        scans=[f"/{laser.topic}" for laser in robot.lasers] if robot else ["/scan"],
        colours=_COLOURS,
    )
    path = job.path(f"{job.name}.foxglove.json")
    return (job.write(path, json.dumps(json.loads(text), ensure_ascii=False, indent=1) + "\n"),)


_COLOURS = (
    "#4e79a7", "#f28e2b", "#e15759", "#76b7b2", "#59a14f", "#edc948", "#b07aa1", "#ff9da7",
    "#9c755f", "#bab0ac",
)  # fmt: skip
