"""What the pre-flight says about the worlds and cells of a campaign, each thing once."""

from __future__ import annotations

import re
from collections.abc import Iterable, Sequence
from dataclasses import replace
from typing import Final

from daemon.campaign._cells import CampaignCell, LoadedWorld
from daemon.campaign._sensors import check_sensors
from daemon.campaign._speed import top_speed
from grammars.jsonld import check_composition
from grammars.preflight import check_limit, check_map, check_run, check_scene
from grammars.text.diagnostics import Diagnostic

_SIZE: Final = re.compile(r"-?\d+\.\d+")
"""A length or an angle in a message; names of objects have no points in their numbers."""


def find_problems(
    worlds: Iterable[LoadedWorld | CampaignCell], cells: Sequence[CampaignCell]
) -> list[Diagnostic]:
    """Return what is wrong with the scenes of ``worlds`` and with what is done in ``cells``."""
    found: list[Diagnostic] = []
    # Scenarios that differ in behaviours or mission only share a scene: it is checked once.
    for world in {id(world.scene): world for world in worlds}.values():
        found.extend(check_composition(world.plan, world.layers))
        found.extend(check_scene(world.scene, places=world.places))
    pairs = ((sut, cell.robot, cell.scenario.where) for cell in cells for sut in cell.suts)
    found.extend(check_sensors(pairs))
    for cell in cells:
        found.extend(_problems_of(cell))
    return found


def _problems_of(cell: CampaignCell) -> Iterable[Diagnostic]:
    if cell.given_map is not None and cell.scenario.map_file is not None:
        yield from check_map(
            cell.given_map,
            cell.scene,
            cell.mission,
            laser_height=cell.robot.laser.z,
            where=cell.scenario.map_file.where,
            places=cell.places,
        )
    yield from check_limit(
        cell.scene,
        cell.robot,
        cell.mission,
        {sut.name: top_speed(sut, cell.robot) for sut in cell.suts},
        limit=cell.limit,
        where=cell.limit_where,
    )
    for behaviours in dict.fromkeys(cell.behaviours):
        yield from check_run(
            cell.scene,
            cell.robot,
            cell.mission,
            behaviours,
            where=cell.mission_where,
            places=cell.places,
        )


def say_once(found: Iterable[Diagnostic]) -> tuple[Diagnostic, ...]:
    """Return the findings without those that another place already has in other sizes."""
    # In another variant of a plan the same door is too narrow by another centimetre.
    kept: dict[tuple[object, ...], list[Diagnostic]] = {}
    for one in dict.fromkeys(found):
        key = (one.where, one.severity, _SIZE.sub("#", one.message))
        kept.setdefault(key, []).append(one)
    return tuple(
        replace(same[0], message=f"{same[0].message} (and {len(same) - 1} more like it)")
        if len(same) > 1
        else same[0]
        for same in kept.values()
    )
