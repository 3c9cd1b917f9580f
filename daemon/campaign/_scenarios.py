"""The scenarios of a campaign file: what each inherits, which layers it names.

Every value names a layer file; a scenario that is ``like`` another is that scenario except for
the slots written here. ``oracles`` and ``behaviours`` replace the inherited list, ``oracles+`` and
``behaviours+`` add to it.
"""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from typing import Any, Final, Literal

from daemon.campaign._file import (
    CampaignFile,
    Chance,
    LayerName,
    MapText,
    Overrides,
    ScenarioText,
    VaryText,
)
from daemon.model.spec import MapSettings
from grammars.text.diagnostics import Diagnostic, InputError, Where, did_you_mean
from grammars.text.documents import YamlDocument, read_model


@dataclass(frozen=True, slots=True)
class LayerReference:
    """A layer by name, with the overrides written beside it and where it stands."""

    name: str
    overrides: Overrides
    where: Where


@dataclass(frozen=True, slots=True)
class PlanVariation:
    """Run the scenario in variants of its floor plan: ``floorplan`` names a variation layer."""

    floorplan: LayerReference
    samples: int | None
    cover: Literal["random", "grid", "halton", "lhs", "pairwise"]
    seed: int


@dataclass(frozen=True, slots=True)
class ResolvedScenario:
    """A scenario after inheritance: every slot filled, nothing loaded yet.

    ``chance`` says whether random behaviours are drawn anew for each repeat or once. With a
    ``map_file`` the map is that file's, else it is drawn as ``map`` says.
    """

    name: str
    where: Where
    about: str = ""
    floorplan: LayerReference | None = None
    objects: tuple[LayerReference, ...] = ()
    behaviours: tuple[LayerReference, ...] = ()
    mission: LayerReference | None = None
    robot: LayerReference | None = None
    suts: tuple[LayerReference, ...] = ()
    oracles: tuple[LayerReference, ...] = ()
    map: MapSettings = field(default_factory=MapSettings)
    map_file: LayerReference | None = None
    vary: PlanVariation | None = None
    chance: Chance = "per repeat"
    limit: float = 0.0


def read_campaign(document: YamlDocument) -> tuple[CampaignFile, tuple[ResolvedScenario, ...]]:
    """Return the file's keys and its concrete scenarios; raises :class:`InputError`."""
    text = read_model(document, CampaignFile)
    problems: list[Diagnostic] = []
    scenarios = []
    for name, scenario in text.scenarios.items():
        try:
            resolved = _resolve_scenario(name, text, document, ())
        except InputError as error:
            problems.extend(error.diagnostics)
            continue
        if not scenario.abstract:
            problems.extend(_missing_slots(resolved))
            scenarios.append(resolved)
    if problems:
        raise InputError(dict.fromkeys(problems))
    if not scenarios:
        raise InputError(
            Diagnostic(document.where(("scenarios",)), "every scenario is abstract, nothing to run")
        )
    return text, tuple(scenarios)


def _resolve_scenario(
    name: str, text: CampaignFile, document: YamlDocument, seen: tuple[str, ...]
) -> ResolvedScenario:
    scenario, path = text.scenarios[name], ("scenarios", name)
    where = document.where(path)
    if scenario.like is None:
        base = _defaults(name, where, text, document)
    else:
        like_at = document.where((*path, "like"))
        # In the order in which people would follow it, to be read as a chain.
        if scenario.like in (*seen, name):
            chain = " -> ".join((*seen, name, scenario.like))
            raise InputError(Diagnostic(like_at, f"scenarios are like each other: {chain}"))
        if scenario.like not in text.scenarios:
            hint = did_you_mean(scenario.like, text.scenarios)
            raise InputError(Diagnostic(like_at, f'no scenario "{scenario.like}" here', hint))
        base = _resolve_scenario(scenario.like, text, document, (*seen, name))
    # The seed of variants that names none is the campaign's, also where the slot is inherited.
    varied = _vary(scenario.vary, (*path, "vary"), text, document) or base.vary
    renamed = replace(base, name=name, where=where, vary=varied)
    return _overlay(renamed, scenario, document, path)


def _defaults(
    name: str, where: Where, text: CampaignFile, document: YamlDocument
) -> ResolvedScenario:
    robot = LayerReference(text.robot, {}, document.where(("robot",))) if text.robot else None
    suts = _references(text.matrix.sut if text.matrix else [], ("matrix", "sut"), document)
    return ResolvedScenario(
        name,
        where,
        robot=robot,
        suts=suts,
        map=text.map.settings(),
        map_file=_map_file(text.map, ("map", "file"), document),
        vary=_vary(text.vary, ("vary",), text, document),
        chance=text.chance,
        limit=text.limit,
    )


def _vary(
    written: VaryText | None, path: tuple[str, ...], text: CampaignFile, document: YamlDocument
) -> PlanVariation | None:
    if written is None:
        return None
    where = document.where((*path, "floorplan"))
    seed = text.seed % 2**32 if written.seed is None else written.seed
    return PlanVariation(
        LayerReference(written.floorplan, {}, where), written.samples, written.cover, seed
    )


_LISTS: Final = {"sut": "suts"} | {key: key for key in ("objects", "behaviours", "oracles")}
"""Slots that hold several layers, by the key people write."""


def _overlay(
    base: ResolvedScenario, scenario: ScenarioText, document: YamlDocument, path: tuple[str, ...]
) -> ResolvedScenario:
    changes: dict[str, Any] = {}
    if scenario.floorplan is not None:
        where = document.where((*path, "floorplan"))
        changes["floorplan"] = _reference(scenario.floorplan, where)
    for slot in ("mission", "robot"):
        value = getattr(scenario, slot)
        if value is not None:
            changes[slot] = LayerReference(value, {}, document.where((*path, slot)))
    # A list takes the place of the inherited one, the key with a plus adds to whichever holds:
    # merging lists in silence is what surprises people elsewhere.
    for key, slot in _LISTS.items():
        value = getattr(scenario, key)
        if value is not None:
            changes[slot] = _references(value, (*path, key), document)
    for slot in ("behaviours", "oracles"):
        more = getattr(scenario, f"more_{slot}") or []
        inherited = changes.get(slot, getattr(base, slot))
        changes[slot] = inherited + _references(more, (*path, f"{slot}+"), document)
    if scenario.map is not None:
        changes["map"] = scenario.map.settings()
        changes["map_file"] = _map_file(scenario.map, (*path, "map", "file"), document)
    for slot in ("limit", "chance", "about"):
        if getattr(scenario, slot):
            changes[slot] = getattr(scenario, slot)
    return replace(base, **changes)


def _map_file(
    written: MapText, path: tuple[str, ...], document: YamlDocument
) -> LayerReference | None:
    return LayerReference(written.file, {}, document.where(path)) if written.file else None


def _references(
    values: list[str] | list[LayerName], path: tuple[str, ...], document: YamlDocument
) -> tuple[LayerReference, ...]:
    return tuple(
        _reference(value, document.where((*path, index))) for index, value in enumerate(values)
    )


def _reference(value: LayerName, where: Where) -> LayerReference:
    if isinstance(value, str):
        return LayerReference(value, {}, where)
    if len(value) != 1:
        hint = "write one list item per layer"
        raise InputError(Diagnostic(where, "expected one layer with its overrides", hint))
    ((name, overrides),) = value.items()
    return LayerReference(name, overrides, where)


_REQUIRED: Final = {
    "floorplan": "floorplan",
    "mission": "mission",
    "robot": "robot",
    "suts": "sut",
    "oracles": "oracles",
}
"""Slots a scenario needs, each with the key people write."""


def _missing_slots(scenario: ResolvedScenario) -> list[Diagnostic]:
    return [
        Diagnostic(scenario.where, f'scenario "{scenario.name}" names no {key}')
        for slot, key in _REQUIRED.items()
        if not getattr(scenario, slot) and not (slot == "floorplan" and scenario.vary)
    ]
