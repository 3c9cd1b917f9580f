"""A run of a campaign taken apart: its elements, and the run without some of them."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path

from daemon.analysis.blame._elements import Element, ElementKind, Elements
from daemon.analysis.blame._sut import SutDifferences, sut_differences
from daemon.campaign import (
    Campaign,
    CampaignCell,
    Composer,
    LayerLibrary,
    LayerReference,
    ResolvedScenario,
    expand,
    load_campaign,
    noise_seed,
)
from daemon.model.spec import OracleText, RunSpec
from grammars.model.behaviour import Walk
from grammars.model.scene import Scene
from grammars.text.diagnostics import Finding, InputError, Where, did_you_mean


@dataclass(frozen=True, slots=True)
class Candidate:
    """A run to execute."""

    spec: RunSpec
    scene: Scene


@dataclass(slots=True)
class RunCase:
    """A run of a campaign with all its elements.

    ``layers`` are scenery layers as the scenario names them, objects before behaviours. The
    elements of a kind are in the order in which the campaign adds them. The scenario itself leaves
    ``left_out`` out.
    """

    campaign: Campaign
    cell: CampaignCell
    folder: Path
    spec: RunSpec
    layers: Mapping[Element, LayerReference]
    settings: SutDifferences
    _composer: Composer
    left_out: Elements = frozenset()
    _worlds: dict[Elements, CampaignCell] = field(default_factory=dict)

    @property
    def added(self) -> tuple[Element, ...]:
        """Layers, overrides and parameters: the additions of the campaign to a bare building."""
        overrides = [one for layer in self.layers.items() for one in _overrides(*layer)]
        return (*self.layers, *overrides, *self.settings.elements)

    def remaining(self, away: Elements) -> tuple[Element, ...]:
        """Return the elements of the run without those that are ``away``."""
        parts = (part for part in _parts(self._world(away)) if part not in self.left_out)
        return tuple(element for element in (*self.added, *parts) if element not in away)

    def scenario(self, away: Elements) -> ResolvedScenario:
        """Return the scenario without the elements that are ``away``.

        Raises :class:`InputError` if the rest is not a world: a layer needs objects that another
        one places.
        """
        world = self._world(away)
        missing = [part for part in _parts(world) if part in away or part in self.left_out]
        objects = {part.name for part in missing if part.kind == "object"}
        ids = [waypoint.id for waypoint in world.mission.waypoints]
        names = (
            _name_in_file(part, ids)
            for part in missing
            # The behaviours of an object are left out with it.
            if part.kind != "behaviour" or part.name.partition(".")[0] not in objects
        )
        without = tuple(LayerReference(name, {}, world.scenario.where) for name in names)
        return replace(world.scenario, without=without)

    def candidate(self, away: Elements, oracle: OracleText, repeat: int | None = None) -> Candidate:
        """Return the run without the elements that are ``away``, judged by ``oracle`` alone.

        ``repeat`` replaces the repeat of the run, if given. Raises ``ValueError``, and
        :class:`InputError` as :meth:`scenario` does, if the rest is not a run: it has no waypoint.
        """
        number = self.spec.repeat if repeat is None else repeat
        cell = self._composer.cell(self._world(away), self.scenario(away), number)
        spec = replace(
            self.spec,
            scene=cell.scene.digest,
            mission=cell.mission,
            behaviours=cell.behaviours[0],
            sut=self.settings.without(away),
            oracles=(oracle,),
            repeat=number,
            seed=noise_seed(self.campaign.seed, number),
        )
        return Candidate(spec, cell.scene)

    def _world(self, away: Elements) -> CampaignCell:
        """Return the cell of the remaining layers with everything that they place."""
        # Most candidates differ only in single things: their layers are composed once.
        key = frozenset(e for e in away if e.kind in ("objects", "behaviours", "override"))
        if key not in self._worlds:
            references: dict[str, list[LayerReference]] = {"objects": [], "behaviours": []}
            for layer, reference in self.layers.items():
                if layer not in key:
                    names = [n for one, n in _overrides(layer, reference).items() if one not in key]
                    values = {name: reference.overrides[name] for name in names}
                    references[layer.kind].append(replace(reference, overrides=values))
            scenario = replace(
                self.cell.scenario,
                objects=tuple(references["objects"]),
                behaviours=tuple(references["behaviours"]),
                without=(),
            )
            self._worlds[key] = self._composer.cell(self.cell, scenario, self.spec.repeat)
        return self._worlds[key]


def load_case(path: Path, scenario: str, sut: str, repeat: int) -> RunCase:
    """Take a run of a campaign file apart.

    ``sut`` may be empty if the scenario has only one. Raises :class:`InputError` for a run outside
    the campaign.
    """
    campaign = load_campaign(path)
    where = Where(campaign.file)
    cells = {cell.name: cell for cell in campaign.cells}
    if scenario not in cells:
        hint = did_you_mean(scenario, cells)
        raise InputError(Finding(where, f'no scenario "{scenario}"', hint))
    cell = cells[scenario]
    names = [reference.name for reference in cell.suts]
    name = names[0] if not sut and len(names) == 1 else sut
    if name not in names:
        message = f'{scenario} has no system under test "{sut}"' if sut else "which of its SUTs?"
        raise InputError(Finding(where, message, did_you_mean(sut, names)))
    planned = expand(campaign)
    # Repeats in reserve are runs like the others.
    for spec in map(planned.spec, (*planned.runs, *planned.reserve)):
        if (spec.scenario, spec.sut.name, spec.repeat) == (scenario, name, repeat):
            return case_of(campaign, cell, spec, path.parent)
    message = f"{scenario} with {name} has no repeat {repeat}"
    raise InputError(Finding(where, message, "repeats count from 0"))


def case_of(campaign: Campaign, cell: CampaignCell, spec: RunSpec, folder: Path) -> RunCase:
    """Take a run of a campaign in ``folder`` apart."""
    library = LayerLibrary(folder)
    composer = Composer(library, campaign.seed)
    scenario = cell.scenario
    whole = composer.cell(cell, replace(scenario, without=()), spec.repeat)
    remaining = composer.cell(cell, scenario, spec.repeat)
    layers: dict[Element, LayerReference] = {}
    for index, reference in enumerate((*scenario.objects, *scenario.behaviours)):
        kind: ElementKind = "objects" if index < len(scenario.objects) else "behaviours"
        layers[Element(kind, library.scenery(reference).name, index)] = reference
    return RunCase(
        campaign=campaign,
        cell=cell,
        folder=folder,
        spec=spec,
        layers=layers,
        settings=sut_differences(cell, spec.sut, library),
        _composer=composer,
        left_out=frozenset(_parts(whole)) - frozenset(_parts(whole, remaining)),
    )


def _overrides(layer: Element, reference: LayerReference) -> dict[Element, str]:
    """Return the campaign's values for the parameters of a layer, with the parameters' names."""
    return {
        Element("override", f"{layer.name}: {name} {value}", layer.index): name
        for name, value in reference.overrides.items()
    }


def _parts(whole: CampaignCell, remaining: CampaignCell | None = None) -> tuple[Element, ...]:
    """Return the single things of a cell, or those that remain in another cell."""
    cell = remaining or whole
    # Compare by identity: a place that is visited twice is two waypoints.
    remaining_ids = {id(waypoint) for waypoint in cell.mission.waypoints}
    waypoints = enumerate(whole.mission.waypoints)
    subjects = (b.object if isinstance(b, Walk) else b.joint for b in cell.behaviours[0])
    return (
        *(Element("object", thing.name) for thing in cell.scene.objects),
        *(Element("waypoint", one.id, i) for i, one in waypoints if id(one) in remaining_ids),
        *(Element("behaviour", subject) for subject in subjects),
    )


def _name_in_file(part: Element, waypoints: Sequence[str]) -> str:
    """Return the name of a part for ``without`` in a campaign; ``waypoints`` are all ids."""
    if part.kind == "waypoint":
        is_name = waypoints.count(part.name) == 1 and not part.name.isdecimal()
        return f"waypoint {part.name if is_name else part.index + 1}"
    return f"behaviour of {part.name}" if part.kind == "behaviour" else part.name
