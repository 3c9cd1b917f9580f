"""Worlds of a campaign, with their behaviours, for artefacts."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

from daemon.campaign import (
    FLOORPLAN,
    MISSION,
    ROBOT,
    SCENERY,
    VARIATION,
    Campaign,
    CampaignCell,
    find_layer,
    load_campaign,
)
from grammars.text.diagnostics import Finding
from grammars.text.sources import model_files
from templates.naming import free_name
from templates.world import ArtefactWorld, BehaviourDraw, named_states


def worlds_of_campaign(
    path: Path, repeats: int | None = None
) -> tuple[tuple[ArtefactWorld, ...], tuple[Finding, ...]]:
    """Return the worlds of a campaign, and the warnings about its layers.

    Scenarios that differ only in oracles or systems under test, which artefacts do not show, are
    one world, under the name of the first. Every variant of a floor plan is a world of its own.
    ``repeats`` limits the repeats whose behaviours are drawn.
    """
    campaign = load_campaign(path)
    worlds: list[ArtefactWorld] = []
    for cell in campaign.cells:
        world = world_of_cell(campaign, cell, repeats)
        if not any(
            replace(other, name=world.name, sources=world.sources) == world for other in worlds
        ):
            worlds.append(replace(world, name=free_name(world.name, [w.name for w in worlds])))
    return tuple(worlds), campaign.warnings


def world_of_cell(
    campaign: Campaign, cell: CampaignCell, repeats: int | None = None
) -> ArtefactWorld:
    """Return the world of one cell; ``repeats`` limits the repeats whose behaviours are drawn."""
    return ArtefactWorld(
        cell.name,
        cell.scene,
        cell.plan,
        cell.mission,
        robot=cell.robot,
        draws=_draws(cell, repeats),
        states=named_states(cell.scene, cell.layers),
        sources=_sources(campaign, cell),
        resolution=cell.map.resolution,
        rule=cell.map.rule,
        doors=cell.map.doors,
        given_map=cell.given_map,
        layers=cell.layers,
    )


def _draws(cell: CampaignCell, repeats: int | None) -> tuple[BehaviourDraw, ...]:
    """Return the behaviours that differ, each under the number of its first repeat."""
    first: dict[object, int] = {}
    # Only random draws differ between repeats; the first of equal draws gives the number.
    for repeat, behaviours in enumerate(cell.behaviours[:repeats]):
        first.setdefault(behaviours, repeat)
    several = len(first) > 1
    return tuple(
        BehaviourDraw(f"repeat-{repeat}" if several else "", cell.behaviours[repeat])
        for repeat in first.values()
    )


def _sources(campaign: Campaign, cell: CampaignCell) -> tuple[Path, ...]:
    """Return the files of a cell, the campaign first."""
    scenario, folder = cell.scenario, Path(campaign.file).parent
    references = [
        (scenario.vary.floorplan, VARIATION) if scenario.vary else (scenario.floorplan, FLOORPLAN),
        *((reference, SCENERY) for reference in (*scenario.objects, *scenario.behaviours)),
        (scenario.mission, MISSION),
        (scenario.robot, ROBOT),
    ]
    layers = [find_layer(folder, reference, kind) for reference, kind in references if reference]
    return (Path(campaign.file), *(file for path in layers for file in model_files(path)))
