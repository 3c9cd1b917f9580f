"""What artefacts are made from: the world of a floor plan, the worlds of a campaign."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from daemon.campaign import Campaign, Cell
    from grammars.diagnostics import Diagnostic
    from templates.world import Draw, World


def world_of_plan(path: Path) -> tuple[World, tuple[Diagnostic, ...]]:
    """Return the world of a floor plan (`.fpm` or `.jsonld`), and the warnings about it."""
    from grammars.composition import compile_scene
    from grammars.floorplan import load_floorplan
    from templates.world import World

    if path.suffix == ".jsonld":
        from grammars.metamodel import load_floorplan_jsonld

        plan = load_floorplan_jsonld(path)
    else:
        plan = load_floorplan(path)
    world = World(path.stem, compile_scene(plan), plan, sources=(path,))
    return world, plan.warnings


def worlds_of_campaign(
    path: Path, repeats: int | None = None
) -> tuple[tuple[World, ...], tuple[Diagnostic, ...]]:
    """Return the worlds of a campaign, and the warnings about its layers.

    Scenarios that differ in nothing artefacts show (only in oracles or systems under test, say)
    are one world, under the name of the first; every variant of a floor plan is a world of its
    own. ``repeats`` limits whose behaviours are drawn.
    """
    from dataclasses import replace

    from daemon.campaign import load_campaign

    campaign = load_campaign(path)
    worlds: list[World] = []
    for cell in campaign.cells:
        world = _world(campaign, cell, repeats)
        if not any(
            replace(other, name=world.name, sources=world.sources) == world for other in worlds
        ):
            worlds.append(replace(world, name=_free(world.name, [w.name for w in worlds])))
    return tuple(worlds), campaign.warnings


def _world(campaign: Campaign, cell: Cell, repeats: int | None) -> World:
    from templates.states import named_states
    from templates.world import World

    return World(
        cell.name,
        cell.scene,
        cell.plan,
        cell.mission,
        robot=cell.robot,
        draws=_draws(cell, repeats),
        states=named_states(cell.scene, cell.layers),
        sources=_sources(campaign, cell),
        resolution=cell.map.resolution,
        layers=cell.layers,
    )


def _draws(cell: Cell, repeats: int | None) -> tuple[Draw, ...]:
    """Return the behaviours that differ, each under the number of its first repeat."""
    from templates.world import Draw

    first: dict[object, int] = {}
    for repeat, behaviours in enumerate(cell.behaviours[:repeats]):
        first.setdefault(behaviours, repeat)
    several = len(first) > 1
    return tuple(
        Draw(f"repeat-{repeat}" if several else "", cell.behaviours[repeat])
        for repeat in first.values()
    )


def _sources(campaign: Campaign, cell: Cell) -> tuple[Path, ...]:
    """Return the files the cell was written in, the campaign first."""
    from daemon.campaign.layers import FLOORPLAN, MISSION, ROBOT, SCENERY, VARIATION, find_layer

    scenario, folder = cell.scenario, Path(campaign.file).parent
    named = [
        (scenario.vary.floorplan, VARIATION) if scenario.vary else (scenario.floorplan, FLOORPLAN),
        *((reference, SCENERY) for reference in (*scenario.objects, *scenario.behaviours)),
        (scenario.mission, MISSION),
        (scenario.robot, ROBOT),
    ]
    found = [find_layer(folder, reference, kind) for reference, kind in named if reference]
    return (Path(campaign.file), *found)


def _free(name: str, taken: list[str]) -> str:
    free, number = name, 2
    while free in taken:
        free, number = f"{name}-{number}", number + 1
    return free
