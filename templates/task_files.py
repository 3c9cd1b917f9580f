"""Task files: waypoints around every space, and the mission of a campaign, as YAML.

Two published forms: ``tasks/<name>_route.yaml`` as the tools write them now, and
``tasks/era/<name>_task.yaml`` with the plain list of waypoints that the experiments of 2024 ran,
there rounded to centimetres.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from pathlib import Path
from typing import Any

from grammars.mission import Mission
from templates.naming import file_name
from templates.tasks import Contour, Stop, inset_contour, route, too_close
from templates.world import Job


def mission_file(job: Job, *, era: bool = False) -> str:
    """Return the mission's task file, relative to the folder of the world."""
    mission = job.world.mission
    name = file_name(mission.name if mission else "mission")
    return f"tasks/era/mission/{name}_task.yaml" if era else f"tasks/mission/{name}_route.yaml"


def write_tasks(job: Job) -> tuple[Path, ...]:
    """Write a task for every space that has a contour, and one for the mission.

    Notes say which spaces have none, or in several parts, and which waypoints are too close to
    what stands in a space.
    """
    written: list[Path] = []
    settings, scene = job.settings, job.world.scene
    height = job.world.robot.height if job.world.robot else job.laser_height
    for region in scene.regions:
        contour = inset_contour(region, settings.distance)
        job.notes.extend(contour.findings)
        for number, owner, away in too_close(scene, contour, settings.distance, height=height):
            job.notes.append(f"{region.name}: waypoint {number} is only {away:.2f} m from {owner}")
        stops = route(
            contour,
            first=settings.first,
            forward=settings.forward,
            closed=settings.closed,
            yaw=settings.yaw,
        )
        if stops:
            name = file_name(region.name)
            paths = f"tasks/{name}_route.yaml", f"tasks/era/{name}_task.yaml"
            written += _write(job, region.name, paths, _of_contour(contour, stops))
    if job.world.mission:
        paths = mission_file(job), mission_file(job, era=True)
        written += _write(job, job.world.mission.name, paths, _of_mission(job.world.mission))
    return tuple(written)


def _write(
    job: Job, name: str, paths: tuple[str, str], waypoints: Sequence[dict[str, Any]]
) -> list[Path]:
    return [
        job.write(
            job.path(*path.split("/")),
            job.templates.render(template, name=name, waypoints=waypoints),
        )
        for path, template in zip(paths, ("route.yaml.j2", "era_task.yaml.j2"), strict=True)
    ]


def _of_contour(contour: Contour, stops: Sequence[Stop]) -> list[dict[str, Any]]:
    several = len(contour.parts) > 1
    found = []
    for stop in stops:
        space = f"{contour.space}-part-{stop.part}" if several else contour.space
        found.append(
            {
                "id": f"{space}-point-{stop.number:04d}",
                "era_id": f"{space}-point-{stop.number}",
                "x": stop.x,
                "y": stop.y,
                "yaw": stop.yaw,
            }
        )
    return found


def _of_mission(mission: Mission) -> list[dict[str, Any]]:
    """Return the mission's waypoints; where any heading will do, the one it arrives with."""
    found = []
    x, y = mission.start.x, mission.start.y
    for stop in mission.waypoints:
        yaw = math.atan2(stop.y - y, stop.x - x) if stop.yaw is None else stop.yaw
        found.append({"id": stop.id, "era_id": stop.id, "x": stop.x, "y": stop.y, "yaw": yaw})
        x, y = stop.x, stop.y
    return found
