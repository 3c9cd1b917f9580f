"""The maps of a world: the building alone, and with its doors in each state."""

from __future__ import annotations

from pathlib import Path

from templates.naming import file_name
from templates.occupancy import occupancy_grid, write_map
from templates.world import Job, start_positions


def map_file(job: Job) -> str:
    """Return the map a navigation stack gets, relative to the folder of the world.

    Worlds with objects have several maps, which then have a folder of their own.
    """
    return f"maps/{job.building}.yaml" if job.world.scene.objects else f"{job.building}.yaml"


def write_maps(job: Job) -> tuple[Path, ...]:
    """Write the map without objects, with objects as they start, and in every named state.

    A state that an object does not have leaves it as it starts.
    """
    scene, height = job.world.scene, job.laser_height
    stem = job.path(*map_file(job).removesuffix(".yaml").split("/"))
    variants: dict[str, dict[str, float] | None] = {"": None}
    if scene.objects:
        start = start_positions(scene, job.world.draws[0].behaviours)
        variants["start"] = start
        variants |= {file_name(name): start | dict(given) for name, given in job.world.states}
    written: list[Path] = []
    for name, joints in variants.items():
        grid = occupancy_grid(scene, resolution=job.resolution, laser_height=height, joints=joints)
        path = stem.with_name(f"{stem.name}-{name}" if name else stem.name)
        written += write_map(grid, path, laser_height=height)
    return tuple(written)
