"""A run of a campaign taken apart: its elements, and the run without some of them."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Final

from daemon.analysis.blame._elements import Element, ElementKind, Elements
from daemon.campaign import (
    Campaign,
    CampaignCell,
    Composer,
    LayerLibrary,
    LayerReference,
    ParameterValues,
    ResolvedScenario,
    expand,
    load_campaign,
    merge_parameters,
    noise_seed,
    parameter_tree,
)
from daemon.model.spec import OracleText, RunSpec, SutReference
from daemon.stacks.registry import check_parameters, stack_kind
from grammars.model.behaviour import Walk
from grammars.model.scene import Scene
from grammars.text.diagnostics import Finding, InputError, Where, did_you_mean
from grammars.text.ros_yaml import ParameterValue

_DEEP: Final = 2
_LONG: Final = 60
"""Most levels of a parameter's name, and characters of its value, in messages."""


@dataclass(frozen=True, slots=True)
class Candidate:
    """A run to execute."""

    spec: RunSpec
    scene: Scene


@dataclass(frozen=True, slots=True)
class SutDifferences:
    """A system under test as changes of a ``base``, each of some settings.

    ``like`` is the name of the base, empty for the defaults of the kind.
    """

    whole: SutReference
    like: str = ""
    base: ParameterValues = field(default_factory=dict)
    changes: tuple[tuple[Element, ParameterValues], ...] = ()

    @property
    def elements(self) -> tuple[Element, ...]:
        """One element for each line with a difference."""
        return tuple(element for element, _ in self.changes)

    def remaining(self, away: Elements) -> ParameterValues:
        """Return the settings of the differences, except those ``away``."""
        settings: ParameterValues = {}
        for element, change in self.changes:
            settings |= change if element not in away else {}
        return settings

    def without(self, away: Elements) -> SutReference:
        """Return the system without the differences that are ``away``.

        Raises ``ValueError`` if its kind refuses these parameters.
        """
        # The identical value keeps the digest of the whole run, which is not executed twice.
        if away.isdisjoint(self.elements):
            return self.whole
        tree = parameter_tree(merge_parameters(self.base, self.remaining(away)))
        sut = replace(self.whole, parameters=tree)
        check_parameters(sut.kind, sut.local_parameters)
        return sut


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


def sut_differences(cell: CampaignCell, sut: SutReference, library: LayerLibrary) -> SutDifferences:
    """Compare a system under test of a cell with the base that its file names.

    The keys of a ROS 2 stack are not taken apart: without one of them it would not start.
    """
    if stack_kind(sut.kind).keys:
        return SutDifferences(sut)
    for reference in cell.scenario.suts:
        loaded = library.loaded_sut(reference)
        if loaded.reference == sut and (loaded.layer.files or loaded.settings):
            break  # otherwise a kind by its name, without a file to compare
    else:
        return SutDifferences(sut)
    files, like = loaded.layer.files, ""
    base: ParameterValues = {}
    if len(files) > 1:
        other = library.sut_file(Path(files[1]))
        like, base = other.reference.name, other.settings
    elif files:
        # Without a base the differences are the values of its own file and of the campaign, on top
        # of the ROS files.
        settings = library.sut_file(Path(files[0])).settings
        base = {path: one for path, one in settings.items() if one.where.file != files[0]}
    return SutDifferences(sut, like, base, _changed_elements(base, loaded.settings))


def _changed_elements(
    base: ParameterValues, settings: ParameterValues
) -> tuple[tuple[Element, ParameterValues], ...]:
    """Return the differences, one element for all values from one place in a file."""
    differing = {
        path: setting
        for path, setting in settings.items()
        if path not in base or base[path].value != setting.value
    }
    nowhere = Where("")
    differing |= {path: ParameterValue(None, nowhere) for path in base if path not in settings}
    groups: dict[object, ParameterValues] = {}
    for path, setting in differing.items():
        # A footprint of five corners, or a common value of two costmaps, is one line of a file and
        # one thing to blame.
        key = setting.where if setting.value is not None else path
        groups.setdefault(key, {})[path] = setting
    return tuple(
        (_parameter_element(group, index), group) for index, group in enumerate(groups.values())
    )


def _parameter_element(group: ParameterValues, index: int) -> Element:
    """Return the element of a line: the shared end of its settings' paths, and the value."""
    paths = list(group)
    shared = 1
    while shared < min(map(len, paths)) and len({path[-shared - 1 :] for path in paths}) == 1:
        shared += 1
    value = group[paths[0]].value
    text = "removed" if value is None else str(value)
    name = "/".join(paths[0][-min(shared, _DEEP) :])
    text = text if len(text) <= _LONG else f"{text[: _LONG - 1]}…"
    return Element("parameter", f"{name}: {text}", index, name)
