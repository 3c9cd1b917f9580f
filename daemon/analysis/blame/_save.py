"""The smallest failing run as a campaign of its own: a folder to pass on."""

from __future__ import annotations

import json
import re
import shutil
from dataclasses import replace
from pathlib import Path
from typing import Any, Final

from daemon.analysis.blame._case import Candidate, RunCase
from daemon.analysis.blame._elements import Blame
from daemon.analysis.blame._runner import BudgetSpentError, CandidateRunner
from daemon.analysis.blame._search import BlameResult
from daemon.campaign import (
    FLOORPLAN,
    MISSION,
    ROBOT,
    SCENERY,
    LayerKind,
    LayerReference,
    ResolvedScenario,
    campaign_text,
    expand,
    find_layer,
    load_campaign,
    parameter_tree,
    required,
)
from daemon.model.attachments import FILES_PARAMETER, stored_file
from daemon.model.spec import RunSpec
from daemon.run_map import stored_map
from daemon.stacks.registry import stack_kind
from grammars.jsonld import scene_document
from grammars.model.map_files import write_map
from grammars.text.yaml_text import yaml_text

SCENARIO: Final = "minimal"


def save_campaign(case: RunCase, result: BlameResult, path: Path, runner: CandidateRunner) -> Path:
    """Write the smallest failing run to the folder ``path`` and return the campaign file.

    Layers are copied unchanged, and the scenario lists the parts to leave out. The campaign
    specifies the failed run, with its seed. Raises ``OSError``, and ``ValueError`` if the files
    would specify another run: a folder that people pass on must fail in the same way.
    """
    path.mkdir(parents=True, exist_ok=True)
    smallest, repeat = _earliest_repeat(case, result, runner)
    (oracle,) = smallest.spec.oracles
    here = case.cell.scenario.where
    scenario = replace(
        _copied(case, case.scenario(result.away), path),
        about="",
        suts=(LayerReference(_write_sut(case, result, path), {}, here),),
        oracles=(LayerReference(oracle.name, {}, here),),
    )
    oracles = _write(path, "minimal.oracles.yaml", yaml_text({oracle.name: oracle.text}))
    text = campaign_text(
        replace(case.campaign, name=_name(case), oracle_layers=(oracles,)),
        scenario,
        name=SCENARIO,
        repeats=repeat + 1,
        about=f"{case.spec.label} of {case.campaign.name}, reduced to what makes it fail",
        comment=_comment(result.story, repeat),
    )
    file = path / _write(path, "campaign.yaml", text)
    _verify(file, smallest.spec)
    return file


def _write(folder: Path, name: str, text: str) -> str:
    """Write a file and return its name."""
    target = folder / name
    target.parent.mkdir(parents=True, exist_ok=True)
    target.write_text(text, encoding="utf-8")
    return name


def _copy(source: Path, folder: Path, name: str) -> None:
    """Copy a layer: a file or a folder."""
    target = folder / name
    target.parent.mkdir(parents=True, exist_ok=True)
    if source.is_dir():
        shutil.copytree(source, target, dirs_exist_ok=True)
    else:
        shutil.copyfile(source, target)


def _earliest_repeat(
    case: RunCase, result: BlameResult, runner: CandidateRunner
) -> tuple[Candidate, int]:
    """Return the run in repeat 0 if it fails there too, otherwise unchanged, with its repeat.

    A campaign always includes all earlier repeats, so repeat 0 gives the smallest one.
    """
    smallest, repeat = result.smallest, case.spec.repeat
    if repeat == 0 or result.story.stopped:
        return smallest, repeat
    first = case.candidate(result.away, smallest.spec.oracles[0], repeat=0)
    try:
        return (first, 0) if runner.first_failing([first]) == 0 else (smallest, repeat)
    except (BudgetSpentError, KeyboardInterrupt):
        return smallest, repeat


def _copied(case: RunCase, scenario: ResolvedScenario, folder: Path) -> ResolvedScenario:
    """Return a scenario that names copies of its layers, in ``folder``."""
    copies: dict[Path, str] = {}

    def copy(reference: LayerReference, kind: LayerKind) -> LayerReference:
        source = find_layer(case.folder, reference, kind)
        if source not in copies:
            name = f"{kind.folder}/{source.name}"
            if name in copies.values():  # a layer of another folder has this name too
                name = f"{kind.folder}/{len(copies)}/{source.name}"
            copies[source] = name
            _copy(source, folder, name)
        return replace(reference, name=copies[source])

    map_file = None
    if case.spec.map.file:
        grid, height = stored_map(case.spec.map.file), case.spec.robot.laser.z
        _, description = write_map(grid, folder / "map", laser_height=height)
        map_file = LayerReference(description.name, {}, scenario.where)
    if scenario.vary is None:
        plan = copy(required(scenario.floorplan), FLOORPLAN)
    else:
        # The receiver of the folder need not draw the variant again.
        text = json.dumps(scene_document(case.cell.plan), indent=1)
        name = _write(folder, f"floorplans/{case.cell.plan.name}.jsonld", text)
        plan = LayerReference(name, {}, scenario.where)
    return replace(
        scenario,
        vary=None,
        floorplan=plan,
        objects=tuple(copy(one, SCENERY) for one in scenario.objects),
        behaviours=tuple(copy(one, SCENERY) for one in scenario.behaviours),
        mission=copy(required(scenario.mission), MISSION),
        robot=copy(required(scenario.robot), ROBOT),
        map_file=map_file,
    )


def _write_sut(case: RunCase, result: BlameResult, folder: Path) -> str:
    """Write the system under test, as differences from its base, if any."""
    sut, settings = result.smallest.spec.sut, case.settings
    text: dict[str, Any] = {"kind": sut.kind, "parameters": sut.parameters}
    changes = parameter_tree(settings.remaining(result.away))
    if own := stack_kind(sut.kind).keys:
        keys = {name: sut.parameters[name] for name in own if name in sut.parameters}
        text = {"kind": sut.kind, **keys}
    elif settings.like and changes and not sut.files:
        # The saved system keeps its name, which verdicts show, so its base gets another one.
        like = settings.like if settings.like != sut.name else f"{sut.name}-base"
        base = {"sut": like, "kind": sut.kind, "parameters": parameter_tree(settings.base)}
        _write(folder, f"suts/{like}.yaml", yaml_text(base))
        text = {"like": like, "parameters": changes}
    if sut.files:
        text[FILES_PARAMETER] = {name: f"files/{name}" for name in sut.files}
    for name, digest in sut.files.items():
        _copy(stored_file(digest), folder, f"suts/files/{name}")
    return _write(folder, f"suts/{sut.name}.yaml", yaml_text({"sut": sut.name, **text}))


def _name(case: RunCase) -> str:
    words = ("blame", case.campaign.name, *case.spec.label.split("/"))
    return re.sub(r"[^A-Za-z0-9_-]+", "-", "-".join(words))[:60]


def _comment(story: Blame, repeat: int) -> str:
    otherwise = ", or fail for another reason" if story.layers else ""
    lines = [
        f"The smallest part of {story.run} that fails {story.verdict.oracle}.",
        f"No other thing can be removed: it would pass{otherwise}."
        if story.minimal
        else f"Other things may be removable: {story.stopped}.",
    ]
    if repeat:
        lines.append(f"Repeat {repeat} fails; earlier ones may pass.")
    return "\n".join(lines)


def _verify(file: Path, expected: RunSpec) -> None:
    """Check that the written campaign specifies the expected run."""
    runs = expand(load_campaign(file)).specs
    specified = next(run for run in runs if run.repeat == expected.repeat)
    names = ("scene", "robot", "mission", "behaviours", "oracles", "map", "seed", "limit", "sut")
    for name in names:
        if getattr(specified, name) != getattr(expected, name):
            raise ValueError(f"{file} would specify another run: its {name} differs")
