"""Which run is meant, and that run taken apart: its elements, and the run any of them make."""

from __future__ import annotations

import dataclasses
import os
import re
from collections.abc import Collection, Iterator, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Final

from daemon.analysis.blame._elements import (
    Element,
    RemainingParts,
    SutDifferences,
    adapt_behaviours,
    sut_differences,
)
from daemon.analysis.rejudge import find_traces
from daemon.batch.paths import StatePaths
from daemon.campaign import (
    Campaign,
    CampaignCell,
    LayerLibrary,
    LayerReference,
    expand,
    load_campaign,
    repeat_seed,
)
from daemon.model.spec import OracleText, RunSpec
from daemon.trace import read_spec
from grammars.model.behaviour import Behaviour, Walk
from grammars.model.movers import is_mover
from grammars.model.scene import Scene
from grammars.scenery import SceneryLayer, configure
from grammars.scenery.composition import compile_scene, resolve_behaviours
from grammars.text.diagnostics import Diagnostic, InputError, Where, did_you_mean

_DEEPEST: Final = 4
"""Campaign files are looked for so many folders below the current one: a whole home takes long."""
_RESULTS: Final = "scenario-results"
"""Commands leave copies of campaigns in a folder of this name, under the names of the originals."""
_SKIPPED: Final = re.compile(r"\.|node_modules\Z|__pycache__\Z")


@dataclass(frozen=True, slots=True)
class CampaignRun:
    """A run of a campaign file; ``note`` says in what it is not the run that was recorded."""

    campaign: Path
    scenario: str
    sut: str
    repeat: int
    note: str = ""


def find_run(words: Sequence[str], paths: StatePaths, campaign: Path | None = None) -> CampaignRun:
    """Return the run that ``words`` name.

    ``CAMPAIGN.yaml SCENARIO [SUT [REPEAT]]``, or a trace, or the id of a run in the ledger. For
    the latter two the layers are needed that a trace does not hold: those of ``campaign``, else
    of the campaign file below the current folder that specifies the very run, of a copy among
    results only if no other one does. Raises ``ValueError`` for what names none,
    :class:`InputError` for files that cannot be used.
    """
    first, *rest = words
    if first.endswith((".yaml", ".yml")):
        return _run_in_file(Path(first), rest)
    if rest:
        raise ValueError("one trace or one id of a run, or CAMPAIGN.yaml SCENARIO SUT REPEAT")
    traces = find_traces([first], paths)
    if len(traces) > 1:
        raise ValueError(f"{first} names {len(traces)} runs, name one of them")
    spec = read_spec(traces[0])
    # A trace holds what was composed, not the layers it was composed of, which are what is blamed.
    file = campaign or _find_campaign_file(spec)
    note = ""
    if campaign is None and _is_copy(file):
        note = f"its layers are read from the copy {file}"
    elif campaign is not None and not _has_run(campaign, spec):
        note = "its layers have changed since: this is about the run as they are now"
    return CampaignRun(file, spec.scenario, spec.sut.name, spec.repeat, note)


def _run_in_file(campaign: Path, rest: Sequence[str]) -> CampaignRun:
    if not 1 <= len(rest) <= 3:
        raise ValueError("name a run of the campaign: SCENARIO SUT REPEAT, such as S1 pilot 0")
    scenario, sut, repeat = (*rest, *("", "0")[len(rest) - 1 :])
    if not repeat.isdecimal():
        raise ValueError(f"{repeat} is not the number of a repeat, they count from 0")
    return CampaignRun(campaign, scenario, sut, int(repeat))


def _find_campaign_file(spec: RunSpec) -> Path:
    """Return the campaign file that specifies a run, among those of its campaign's name."""
    # By a line of its text before it is loaded: most YAML files of a project are no campaigns.
    named = [path for path in _yaml_files(Path()) if _is_campaign_named(path, spec.campaign)]
    named.sort(key=_is_copy)
    for path in named:
        if _has_run(path, spec):
            return path
    if named:
        files = ", ".join(map(str, named))
        raise ValueError(
            f"{files} does not specify this run any more: say --campaign {named[0]} "
            "to ask about the run as its layers are now"
        )
    raise ValueError(
        f"no campaign file {spec.campaign} below this folder, and a trace does not hold the "
        "layers: say --campaign FILE"
    )


def _is_copy(path: Path) -> bool:
    return _RESULTS in path.parts


def _yaml_files(folder: Path) -> Iterator[Path]:
    for place, folders, files in os.walk(folder):
        depth = len(Path(place).parts)
        wanted = [name for name in sorted(folders) if not _SKIPPED.match(name)]
        folders[:] = wanted if depth < _DEEPEST else []
        yield from (Path(place, name) for name in sorted(files) if name.endswith((".yaml", ".yml")))


def _is_campaign_named(path: Path, campaign: str) -> bool:
    pattern = rf"^campaign:\s*[\"']?{re.escape(campaign)}[\"']?\s*(#.*)?$"
    try:
        return re.search(pattern, path.read_text(encoding="utf-8"), re.MULTILINE) is not None
    except (OSError, UnicodeDecodeError):
        return False


def _has_run(path: Path, spec: RunSpec) -> bool:
    try:
        return spec.digest in expand(load_campaign(path)).digests
    except InputError:
        return False


@dataclass(frozen=True, slots=True)
class Candidate:
    """A run to execute."""

    spec: RunSpec
    scene: Scene


@dataclass(frozen=True, slots=True)
class ScenarioLayer:
    """A scenery layer of the scenario as its file has it, and what the campaign says about it."""

    element: Element
    reference: LayerReference
    plain: SceneryLayer
    overrides: tuple[tuple[Element, str, object], ...]


@dataclass(slots=True)
class RunCase:
    """A run of a campaign with everything it is made of.

    ``layers`` are in the order of the scenario, objects before behaviours. The elements of a kind
    are in the order in which the campaign adds them.
    """

    campaign: Campaign
    cell: CampaignCell
    folder: Path
    spec: RunSpec
    scene: Scene
    layers: tuple[ScenarioLayer, ...]
    settings: SutDifferences
    _worlds: dict[frozenset[Element], tuple[Scene, tuple[Behaviour, ...]]] = field(
        default_factory=dict
    )

    @property
    def added(self) -> tuple[Element, ...]:
        """Layers, overrides and parameters: what the campaign adds to a bare building."""
        layers = [layer.element for layer in self.layers]
        overrides = [element for layer in self.layers for element, _, _ in layer.overrides]
        return (*layers, *overrides, *self.settings.elements)

    def parts(self, added: Collection[Element]) -> tuple[Element, ...]:
        """Return the single things in a run of the elements ``added``."""
        scene, behaviours = self._world(added)
        waypoints = self.spec.mission.waypoints
        return (
            *(Element("object", thing.name) for thing in scene.objects),
            *(Element("waypoint", waypoint.id, i) for i, waypoint in enumerate(waypoints)),
            *(Element("behaviour", behaviour_subject(behaviour)) for behaviour in behaviours),
        )

    def candidate(self, kept: Collection[Element], oracle: OracleText) -> Candidate:
        """Return the run that is made of ``kept``, judged by ``oracle`` alone.

        Raises :class:`InputError` or ``ValueError`` when they make no run: a layer speaks of
        objects that another one places, no waypoint is left.
        """
        scene, behaviours = self._world(kept)
        scene = scene_with_objects(scene, {e.name for e in kept if e.kind == "object"})
        indices = [e.index for e in kept if e.kind == "waypoint"]
        mission = self.spec.mission
        waypoints = tuple(w for i, w in enumerate(mission.waypoints) if i in indices)
        if not waypoints:
            raise ValueError("no waypoint is left")
        names = {e.name for e in kept if e.kind == "behaviour"}
        surviving = RemainingParts(frozenset(scene.joint_names), tuple(sorted(indices)), waypoints)
        spec = dataclasses.replace(
            self.spec,
            scene=scene.digest,
            mission=dataclasses.replace(mission, waypoints=waypoints),
            behaviours=adapt_behaviours(
                (b for b in behaviours if behaviour_subject(b) in names), surviving
            ),
            sut=self.settings.sut(kept),
            oracles=(oracle,),
        )
        return Candidate(spec, scene)

    def _world(self, kept: Collection[Element]) -> tuple[Scene, tuple[Behaviour, ...]]:
        """Return the scene of the kept layers with everything in it, and what its joints do."""
        # Most candidates differ in single things only: what they are made of is compiled once.
        key = frozenset(e for e in kept if e.kind in ("objects", "behaviours", "override"))
        if key not in self._worlds:
            self._worlds[key] = self._composed(key)
        return self._worlds[key]

    def _composed(self, kept: frozenset[Element]) -> tuple[Scene, tuple[Behaviour, ...]]:
        used = [layer for layer in self.layers if layer.element in kept]
        layers = [_configured(layer, kept) for layer in used]
        objects = [
            layer for layer, use in zip(layers, used, strict=True) if use.element.kind == "objects"
        ]
        scene = compile_scene(self.cell.plan, objects)
        # The draws of the run itself, so that random doors move as they did.
        draw = self.spec.repeat if self.cell.scenario.chance == "per repeat" else 0
        seed = repeat_seed(self.campaign.seed, draw)
        found = resolve_behaviours(scene, layers, seed=seed, limit=self.spec.limit)
        return scene, found.behaviours


def _configured(layer: ScenarioLayer, kept: Collection[Element]) -> SceneryLayer:
    wanted = {key: value for element, key, value in layer.overrides if element in kept}
    return configure(layer.plain, wanted, layer.reference.where)


def behaviour_subject(behaviour: Behaviour) -> str:
    """Return what people call a behaviour: its joint, or the mover that walks."""
    return behaviour.object if isinstance(behaviour, Walk) else behaviour.joint


def scene_with_objects(scene: Scene, names: Collection[str]) -> Scene:
    """Return ``scene`` as if only the objects of these names had been put into it."""
    objects = tuple(thing for thing in scene.objects if thing.name in names)
    # As the compiler has it: only scenes with movers keep the frames their routes refer to. Else
    # the scene would have another digest than the same one compiled from the saved campaign.
    frames = scene.frames if any(is_mover(thing.joints) for thing in objects) else ()
    return dataclasses.replace(scene, objects=objects, frames=frames)


def load_case(path: Path, scenario: str, sut: str, repeat: int) -> RunCase:
    """Take a run of a campaign file apart.

    ``sut`` may be empty when the scenario has only one. Raises :class:`InputError` for what the
    campaign does not have.
    """
    campaign = load_campaign(path)
    cell = _find_cell(campaign, scenario)
    name = _find_sut(campaign, cell, sut)
    runs = expand(campaign).specs
    found = [r for r in runs if (r.scenario, r.sut.name, r.repeat) == (scenario, name, repeat)]
    if not found:
        message = f"{scenario} with {name} has no repeat {repeat}"
        raise InputError(Diagnostic(Where(campaign.file), message, "repeats count from 0"))
    return case_of(campaign, cell, found[0], path.parent)


def case_of(campaign: Campaign, cell: CampaignCell, spec: RunSpec, folder: Path) -> RunCase:
    """Take a run apart that a scenario of a campaign in ``folder`` specifies."""
    library = LayerLibrary(folder)
    return RunCase(
        campaign=campaign,
        cell=cell,
        folder=folder,
        spec=spec,
        scene=cell.scene,
        layers=_layers(cell, library),
        settings=sut_differences(cell, spec.sut, library),
    )


def _find_cell(campaign: Campaign, scenario: str) -> CampaignCell:
    for cell in campaign.cells:
        if cell.name == scenario:
            return cell
    hint = did_you_mean(scenario, [cell.name for cell in campaign.cells])
    raise InputError(Diagnostic(Where(campaign.file), f'no scenario "{scenario}"', hint))


def _find_sut(campaign: Campaign, cell: CampaignCell, name: str) -> str:
    names = [sut.name for sut in cell.suts]
    if not name and len(names) == 1:
        return names[0]
    if name in names:
        return name
    message = f'{cell.name} has no system under test "{name}"' if name else "which one of its SUTs?"
    raise InputError(Diagnostic(Where(campaign.file), message, did_you_mean(name, names)))


def _layers(cell: CampaignCell, library: LayerLibrary) -> tuple[ScenarioLayer, ...]:
    scenario = cell.scenario
    found = []
    for index, reference in enumerate((*scenario.objects, *scenario.behaviours)):
        objects = index < len(scenario.objects)
        plain = library.scenery(reference)
        overrides = tuple(
            (Element("override", f"{plain.name}: {key} {value}", index), key, value)
            for key, value in reference.overrides.items()
        )
        element = Element("objects" if objects else "behaviours", plain.name, index)
        found.append(ScenarioLayer(element, reference, plain, overrides))
    return tuple(found)
