"""Which run is meant, and that run taken apart: its elements, and the run any of them make."""

from __future__ import annotations

import dataclasses
from collections.abc import Collection, Sequence
from contextlib import suppress
from dataclasses import dataclass, field
from pathlib import Path

from daemon.analysis.blame._elements import (
    Element,
    RemainingParts,
    SutDifferences,
    adapt_behaviours,
    sut_differences,
)
from daemon.analysis.rejudge import find_traces
from daemon.analysis.report import open_ledger, read_campaign_note
from daemon.batch.errors import Refused
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
    the latter two the layers are needed that a trace does not hold: those of ``campaign``,
    otherwise of the campaign file that the record of the run names, as long as it specifies that
    very run. Raises ``ValueError`` for what names none, :class:`InputError` for files that cannot
    be used.
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
    file = campaign or _recorded_file(first, traces[0], paths)
    note = ""
    if not _has_run(file, spec):
        if campaign is None:
            raise ValueError(
                f"{file} does not specify this run any more: say --campaign {file} "
                "to ask about the run as its layers are now"
            )
        note = "its layers have changed since: this is about the run as they are now"
    return CampaignRun(file, spec.scenario, spec.sut.name, spec.repeat, note)


def _run_in_file(campaign: Path, rest: Sequence[str]) -> CampaignRun:
    if not 1 <= len(rest) <= 3:
        raise ValueError("name a run of the campaign: SCENARIO SUT REPEAT, such as S1 pilot 0")
    scenario, sut, repeat = (*rest, *("", "0")[len(rest) - 1 :])
    if not repeat.isdecimal():
        raise ValueError(f"{repeat} is not the number of a repeat, they count from 0")
    return CampaignRun(campaign, scenario, sut, int(repeat))


def _recorded_file(name: str, trace: Path, paths: StatePaths) -> Path:
    """Return the campaign file that the record of a run names.

    The record is the ledger, or what ``scenario run`` left beside the trace. Raises ``ValueError``
    for a run without one, and for a file that is not there any more.
    """
    origin = read_campaign_note(trace.parent).origin
    campaign = trace.parent.name if Path(name).is_file() else name.partition(".")[0]
    if not origin.path and paths.ledger.is_file():
        with suppress(Refused), open_ledger(paths) as ledger:
            origin = ledger.origin(campaign)
    if not origin.path:
        raise ValueError(f"no record names the campaign file of {trace}: say --campaign FILE")
    if not Path(origin.path).is_file():
        raise ValueError(f"there is no {origin.path} any more: say --campaign FILE")
    return Path(origin.path)


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
