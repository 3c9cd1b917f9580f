"""Checks of single files: the kind of a file and the findings about it."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Final

from grammars.text.diagnostics import Finding, InputError, Where
from grammars.text.file_kinds import kind_of_file, refuse_kind
from grammars.text.sources import is_folder, is_jsonld, refuse_unreadable
from grammars.text.words import count_noun
from scenario_tui.library.campaign import Campaign, load

Checker = Callable[[Path], tuple[str, tuple[Finding, ...]]]


def check(path: str | Path) -> list[Finding]:
    """Return the findings, errors and warnings, about any file of a campaign; ``[]`` is good.

    It may be a campaign, a floor plan, scenery, a mission, a robot, a system under test, oracles,
    walls, a variation or JSON-LD. Nothing is run.
    """
    return list(check_file(Path(path))[1])


def check_file(path: Path, *, base: str = "") -> tuple[str, tuple[Finding, ...]]:
    """Return the kind of a file in a few words and its findings, errors and warnings.

    Relative identifiers of JSON-LD resolve against ``base``, otherwise against the file's address.
    """
    try:
        checker = _checker(path)
        return _jsonld(path, base) if checker is _jsonld else checker(path)
    except InputError as error:
        return "", error.findings


def _checker(path: Path) -> Checker:
    if is_folder(path):
        if is_jsonld(path):
            return _jsonld
        raise InputError(Finding(Where(str(path)), "is a folder", "name the files in it"))
    refuse_unreadable(path)
    for ending, checker in _BY_ENDING.items():
        if path.name.endswith(ending):
            return checker
    if path.suffix not in (".yaml", ".yml"):
        refuse_kind(kind_of_file(path), Where(str(path)))
        hint = f"known: {', '.join(_BY_ENDING)}, .yaml"
        raise InputError(Finding(Where(str(path)), "is no kind of file known here", hint))
    return _yaml


# Each imports its own language: one file needs one of them, and all load slowly.
def _building(path: Path) -> tuple[str, tuple[Finding, ...]]:
    from grammars.floorplan import WALLS_ENDING, load_floorplan
    from grammars.maps import load_walls
    from grammars.preflight import check_scene
    from grammars.scenery.composition import compile_scene

    if path.name.endswith(WALLS_ENDING):
        plan, kind = load_walls(path), "walls layer"
        parts = (count_noun(len(plan.features), "wall"), count_noun(len(plan.openings), "entryway"))
    else:
        plan, kind = load_floorplan(path), "floor plan"
        parts = (count_noun(len(plan.walls), "wall"), count_noun(len(plan.openings), "opening"))
    findings = (*plan.warnings, *check_scene(compile_scene(plan, ())))
    about = f"{kind} with {', '.join((count_noun(len(plan.spaces), 'space'), *parts))}"
    return about, tuple(dict.fromkeys(findings))


def _scenery(path: Path) -> tuple[str, tuple[Finding, ...]]:
    from grammars.scenery import load_scenery

    load_scenery(path)
    return "scenery layer", ()


def _variation(path: Path) -> tuple[str, tuple[Finding, ...]]:
    from grammars.variation import load_variation

    variation = load_variation(path)
    return (
        f"variation of {variation.plan_name} with {count_noun(len(variation.draws), 'draw')}",
        variation.warnings,
    )


def _jsonld(path: Path, base: str = "") -> tuple[str, tuple[Finding, ...]]:
    from grammars.jsonld import check_jsonld

    return "JSON-LD graph", check_jsonld(path, base)


def _mission(path: Path) -> tuple[str, tuple[Finding, ...]]:
    from grammars.model.mission_files import load_mission

    mission, _ = load_mission(path)
    return f"mission with {count_noun(len(mission.waypoints), 'waypoint')}", ()


def _oracles(path: Path) -> tuple[str, tuple[Finding, ...]]:
    from grammars.oracle import load_oracles

    return count_noun(len(load_oracles(path)), "oracle"), ()


def _yaml(path: Path) -> tuple[str, tuple[Finding, ...]]:
    """Check a YAML file as the kind that its keys name: mission, robot, system or campaign."""
    from grammars.text.documents import load_yaml

    data = load_yaml(path).data
    keys = data.keys() if isinstance(data, dict) else set()
    if {"campaign", "scenarios", "matrix", "defaults"} & keys:
        return _campaign(path)
    if "waypoints" in keys:
        return _mission(path)
    if "robot" in keys:
        from grammars.model.robot_files import load_robot

        return f"robot {load_robot(path).name}", ()
    if "sut" in keys:
        from daemon.campaign import LayerLibrary, LayerReference

        library = LayerLibrary(path.parent)
        sut = library.sut(LayerReference(path.name, {}, Where(str(path), 1, 1)))
        return f"system under test {sut.name}", tuple(library.warnings)
    return _campaign(path)


def _campaign(path: Path) -> tuple[str, tuple[Finding, ...]]:
    campaign = load(path)
    findings = tuple(campaign.check())
    return campaign_words(campaign), findings


def campaign_words(campaign: Campaign) -> str:
    """Return how many scenarios, runs and searches a campaign has."""
    checked = campaign.checked
    cells, policy = sum(len(cell.suts) for cell in checked.cells), checked.declared.policy
    more = f", up to {cells * policy.at_most:,}" if policy.until_decided else ""
    parts = [
        count_noun(len(checked.cells), "scenario"),
        count_noun(checked.runs, "run") + more,
    ]
    if checked.searches:
        parts.append(count_noun(len(checked.searches), "search", "searches"))
    if checked.allowed:
        parts.append(f"{count_noun(len(checked.allowed), 'warning')} allowed")
    return ", ".join(parts)


_BY_ENDING: Final[dict[str, Checker]] = {
    ".fpm": _building,
    ".scenery": _scenery,
    ".variation": _variation,
    ".jsonld": _jsonld,
    ".json": _jsonld,
    ".mission.yaml": _mission,
    ".oracles.yaml": _oracles,
    ".walls.yaml": _building,
}
