"""The scenarios of a campaign file, their inheritance and the layers that they name.

Every value names a layer file. Keys at the top of the file hold for all scenarios; those below
``defaults`` win over them. A scenario that is ``like`` another is that scenario except for the
slots written here. ``oracles`` and ``behaviours`` replace the inherited list, ``oracles+`` and
``behaviours+`` add to it.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import partial
from typing import Any, Final, Literal, TypeVar

from daemon.campaign._file import (
    CampaignFile,
    Chance,
    LayerName,
    MapText,
    Overrides,
    SlotsText,
    VaryText,
)
from daemon.model.search import ParameterSlot
from daemon.model.spec import MapSettings
from grammars.oracle import Oracle
from grammars.text.diagnostics import (
    Finding,
    InputError,
    Where,
    did_you_mean,
    gather,
    raise_all,
    with_article,
)
from grammars.text.documents import KeyPath, YamlDocument
from grammars.text.overrides import Override, flatten_overrides


@dataclass(frozen=True, slots=True)
class LayerReference:
    """A layer by name, with the overrides beside it and its place in the file.

    ``places`` are those of the overrides, by their paths; overrides not among them have the place
    of the name.
    """

    name: str
    overrides: Overrides
    where: Where
    places: Mapping[KeyPath, Where] = field(default_factory=dict, compare=False)

    @property
    def values(self) -> tuple[Override, ...]:
        """The overrides by their dotted keys, each with its place."""
        return flatten_overrides(self.overrides, self.place)

    @property
    def lines(self) -> dict[str, Where]:
        """The place of each override, by its key."""
        return {key: self.place((key,)) for key in self.overrides}

    def as_written(self) -> str | dict[str, Overrides]:
        """Return it as written in a campaign."""
        return {self.name: dict(self.overrides)} if self.overrides else self.name

    def with_values(self, values: Mapping[str, object]) -> LayerReference:
        """Return the reference with overrides that win over those of the same keys."""
        # The last value of a key holds, even if its name is spelled in two ways.
        others = {key: value for key, value in self.overrides.items() if key not in values}
        places = {path: where for path, where in self.places.items() if path[0] in others}
        return replace(self, overrides={**others, **values}, places=places)

    def place(self, path: KeyPath) -> Where:
        """Return the place of the override at ``path``, or of the override around it."""
        ends = range(len(path), 0, -1)
        return next((self.places[path[:n]] for n in ends if path[:n] in self.places), self.where)


MOST_LIKE: Final = 50
"""Longest chain of scenarios or systems under test that are like one another."""


@dataclass(frozen=True, slots=True)
class PlanVariation:
    """Run the scenario in variants of its floor plan: ``floorplan`` names a variation layer."""

    floorplan: LayerReference
    samples: int | None
    cover: Literal["random", "grid", "halton", "lhs"]
    seed: int


@dataclass(frozen=True, slots=True)
class ResolvedScenario:
    """A scenario after inheritance: every slot filled, nothing loaded yet.

    ``without`` names parts of the composed world that are left out (see :mod:`._composer`).
    ``chance`` says whether random behaviours are drawn anew for each repeat or once. The map comes
    from ``map_file``, if any, and is otherwise drawn by the settings ``map``.
    """

    name: str
    where: Where
    about: str = ""
    floorplan: LayerReference | None = None
    objects: tuple[LayerReference, ...] = ()
    behaviours: tuple[LayerReference, ...] = ()
    mission: LayerReference | None = None
    without: tuple[LayerReference, ...] = ()
    robot: LayerReference | None = None
    suts: tuple[LayerReference, ...] = ()
    oracles: tuple[LayerReference, ...] = ()
    map: MapSettings = field(default_factory=MapSettings)
    map_file: LayerReference | None = None
    vary: PlanVariation | None = None
    chance: Chance = "per repeat"
    limit: float = 0.0

    @property
    def oracle_names(self) -> tuple[str, ...]:
        """The names of its oracles."""
        return tuple(reference.name for reference in self.oracles)

    @property
    def sut_names(self) -> tuple[str, ...]:
        """The names of its systems under test, as written."""
        return tuple(reference.name for reference in self.suts)


def resolve_scenarios(text: CampaignFile, document: YamlDocument) -> dict[str, ResolvedScenario]:
    """Return the concrete scenarios of a campaign file by name.

    Raises :class:`InputError` with the errors of all scenarios.
    """
    resolved = gather(partial(resolve_scenario, name, text, document) for name in text.scenarios)
    concrete = [one for one in resolved if not text.scenarios[one.name].abstract]
    if not concrete:
        where = document.where(("scenarios",))
        raise InputError(Finding(where, "every scenario is abstract, nothing to run"))
    raise_all(_missing_slots(concrete, text, document))
    return {one.name: one for one in concrete}


def resolve_scenario(
    name: str, text: CampaignFile, document: YamlDocument, followers: tuple[str, ...] = ()
) -> ResolvedScenario:
    """Return a scenario with its inherited slots; raises :class:`InputError`.

    ``followers`` are the scenarios that are like this one.
    """
    scenario, path = text.scenarios[name], ("scenarios", name)
    where = document.where(path)
    if scenario.like is None:
        base = _overlay(
            _from_the_top(name, where, text, document), text.defaults, document, ("defaults",)
        )
        varied = _vary(text.defaults.vary, ("defaults", "vary"), text, document)
        base = replace(base, vary=varied or base.vary)
    else:
        like_at = document.where((*path, "like"))
        # The message shows the chain in the order in which people would follow it.
        if scenario.like in (*followers, name):
            chain = " -> ".join((*followers, name, scenario.like))
            raise InputError(Finding(like_at, f"scenarios are like each other: {chain}"))
        if scenario.like not in text.scenarios:
            hint = did_you_mean(scenario.like, text.scenarios)
            raise InputError(Finding(like_at, f'no scenario "{scenario.like}" here', hint))
        if len(followers) >= MOST_LIKE:
            message = f"more than {MOST_LIKE} scenarios are like one another in a row"
            raise InputError(Finding(like_at, message, "be like one near the first of them"))
        base = resolve_scenario(scenario.like, text, document, (*followers, name))
    # Without a seed of their own, variants use the campaign's, even in an inherited slot.
    varied = _vary(scenario.vary, (*path, "vary"), text, document) or base.vary
    renamed = replace(base, name=name, where=where, vary=varied)
    return _overlay(renamed, scenario, document, path)


def limit_place(name: str, text: CampaignFile, document: YamlDocument) -> Where:
    """Return the place of a scenario's limit: in it, in a base, or at the top of the file."""
    base: str | None = name
    while base is not None:
        if text.scenarios[base].limit is not None:
            return document.where(("scenarios", base, "limit"))
        base = text.scenarios[base].like
    return document.where(("limit",) if text.defaults.limit is None else ("defaults", "limit"))


def _from_the_top(
    name: str, where: Where, text: CampaignFile, document: YamlDocument
) -> ResolvedScenario:
    robot = _reference(text.robot, ("robot",), document) if text.robot else None
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
    vary: VaryText | None, path: tuple[str, ...], text: CampaignFile, document: YamlDocument
) -> PlanVariation | None:
    if vary is None:
        return None
    reference = _reference(vary.floorplan, (*path, "floorplan"), document)
    seed = text.seed % 2**32 if vary.seed is None else vary.seed
    return PlanVariation(reference, vary.samples, vary.cover, seed)


_LISTS: Final = {"sut": "suts"} | {
    key: key for key in ("objects", "behaviours", "oracles", "without")
}
"""Slots that hold several names, by the key in the file."""


def _overlay(
    base: ResolvedScenario, scenario: SlotsText, document: YamlDocument, path: tuple[str, ...]
) -> ResolvedScenario:
    """Return ``base`` with the slots of ``scenario`` over it, except the variants of its plan."""
    changes: dict[str, Any] = {}
    for slot in ("floorplan", "mission", "robot"):
        value = getattr(scenario, slot)
        if value is not None:
            changes[slot] = _reference(value, (*path, slot), document)
    # A list replaces the inherited one, and the key with a plus adds to the current one: a silent
    # merge of lists surprises people in other tools.
    for key, slot in _LISTS.items():
        value = getattr(scenario, key)
        if value is not None:
            changes[slot] = _references(value, (*path, key), document)
    for slot in ("behaviours", "oracles"):
        more = getattr(scenario, f"more_{slot}", None) or []
        inherited = changes.get(slot, getattr(base, slot))
        changes[slot] = inherited + _references(more, (*path, f"{slot}+"), document)
    if scenario.map is not None:
        changes["map"] = scenario.map.settings()
        changes["map_file"] = _map_file(scenario.map, (*path, "map", "file"), document)
    for slot in ("limit", "chance", "about"):
        if getattr(scenario, slot, None):
            changes[slot] = getattr(scenario, slot)
    return replace(base, **changes)


def _map_file(
    text: MapText, path: tuple[str, ...], document: YamlDocument
) -> LayerReference | None:
    return LayerReference(text.file, {}, document.where(path)) if text.file else None


def _references(
    values: list[str] | list[LayerName], path: tuple[str, ...], document: YamlDocument
) -> tuple[LayerReference, ...]:
    return tuple(_reference(value, (*path, index), document) for index, value in enumerate(values))


def _reference(value: LayerName, path: KeyPath, document: YamlDocument) -> LayerReference:
    where = document.where(path)
    if isinstance(value, str):
        return LayerReference(value, {}, where)
    if len(value) != 1:
        hint = "write one list item per layer"
        raise InputError(Finding(where, "expected one layer with its overrides", hint))
    ((name, overrides),) = value.items()
    # A single layer may stand in place of a list: "behaviours: {doors: {…}}".
    at = (*path, name) if (*path, name) in document.places else (*path[:-1], name)
    inside = ((p[len(at) :], where) for p, where in document.places.items() if p[: len(at)] == at)
    return LayerReference(
        name, overrides, where, {below: where for below, where in inside if below}
    )


T = TypeVar("T")


def required(value: T | None) -> T:
    """Return the value of a slot of a resolved scenario; ``ValueError`` for an empty one."""
    if value is None:
        raise ValueError("a resolved scenario has no empty slot")
    return value


_BELOW: Final = 'write in the scenario, or under "defaults:" for all of them'
_TOP: Final = "write at the top of the file"
_SHIPPED: Final = "(`scenario new --layers` lists shipped ones)"
_REQUIRED: Final = {
    "floorplan": f"{_BELOW}: floorplan: flat (the file flat.fpm)",
    "mission": f"{_BELOW}: mission: courier (the file courier.mission.yaml)",
    "robot": f"{_TOP}, or in the scenario for that one alone: robot: courier {_SHIPPED}",
    "suts": f"{_TOP}: matrix: {{sut: [pilot]}} {_SHIPPED}",
    "oracles": f"{_BELOW}: oracles: [reached, no-contact]",
}
"""Slots that a scenario needs, each with its place in the file and an example."""


def _missing_slots(
    scenarios: Sequence[ResolvedScenario], text: CampaignFile, document: YamlDocument
) -> list[Finding]:
    """Return an error for every empty slot that a scenario needs."""
    problems = []
    for slot, hint in _REQUIRED.items():
        key = "sut" if slot == "suts" else slot
        missing = [
            scenario
            for scenario in scenarios
            if not getattr(scenario, slot) and not (slot == "floorplan" and scenario.vary)
        ]
        if slot == "oracles":
            hint = f"{_oracle_files(text)}; which of their lines judge a scenario, {hint}"
        if len(missing) == len(scenarios) > 1:
            # A slot that is empty in all scenarios is one mistake.
            where = document.where(("scenarios",))
            named = key if key == "oracles" else with_article(key)
            problems.append(Finding(where, f"no scenario names {named}", hint))
            continue
        problems += [Finding(s.where, f'scenario "{s.name}" names no {key}', hint) for s in missing]
    return problems


def _oracle_files(text: CampaignFile) -> str:
    if text.oracles:
        named = ", ".join(text.oracles)
        return f'"oracles: {named}" at the top names files that hold oracles'
    return (
        '"oracles: navigation" at the top of the file names navigation.oracles.yaml, '
        "a file of lines such as: no-contact: never(contact)"
    )


def pick_oracles(
    scenario: ResolvedScenario, pool: Mapping[str, Oracle], text: CampaignFile
) -> tuple[Oracle, ...]:
    """Return the oracles that a scenario names, from the ``pool`` of the campaign.

    Raises :class:`InputError` for all unknown ones.
    """
    unknown = [
        Finding(r.where, f'no oracle "{r.name}"', _oracle_hint(r.name, pool, text))
        for r in scenario.oracles
        if r.name not in pool
    ]
    if unknown:
        raise InputError(unknown)
    return tuple(pool[r.name] for r in scenario.oracles)


def _oracle_hint(name: str, pool: Mapping[str, Oracle], text: CampaignFile) -> str:
    if not text.oracles:
        return _oracle_files(text)
    if "(" in name:
        return f"write the condition as a line of {text.oracles[0]}, and its name here"
    if name in text.oracles:
        some = ", ".join(list(pool)[:3])
        return f"that is a file: name lines of it here, such as: oracles: [{some}]"
    return did_you_mean(name, pool)


def with_overrides(
    scenario: ResolvedScenario, slot: ParameterSlot, index: int, values: Mapping[str, object]
) -> ResolvedScenario:
    """Return a scenario with other values beside the ``index``-th layer name of a slot.

    They win over the values in the file. Raises ``ValueError`` if there is no such layer.
    """
    if slot == "vary" and scenario.vary is not None:
        plan = scenario.vary.floorplan.with_values(values)
        return replace(scenario, vary=replace(scenario.vary, floorplan=plan))
    name = "suts" if slot == "sut" else slot
    slotted = getattr(scenario, name)
    layers = [slotted] if isinstance(slotted, LayerReference) else list(slotted or ())
    if not 0 <= index < len(layers):
        raise ValueError(f"{scenario.name} has no layer {index} in {slot}")
    layers[index] = layers[index].with_values(values)
    changed: Any = layers[0] if isinstance(slotted, LayerReference) else tuple(layers)
    return replace(scenario, **{name: changed})
