"""Names in a search, resolved to values of layers, in the unit of a range.

A name is looked up in the layers of the scenario. The layer itself checks another value under that
name, so errors are the same as in a campaign file.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any, Final, get_args

from pydantic.fields import FieldInfo

from daemon.campaign._layers import FLOORPLAN, VARIATION, CampaignCell, LayerLibrary, find_layer
from daemon.campaign._scenarios import LayerReference, ResolvedScenario, required
from daemon.model.search import ParameterSlot
from daemon.stacks.registry import stack_kind
from grammars.floorplan import WALLS_ENDING
from grammars.model.mission_files import MissionText
from grammars.model.robot_files import RobotText
from grammars.text.diagnostics import Finding, InputError, Where, did_you_mean
from grammars.text.documents import KeyPath, StrictModel, YamlDocument, read_model, written_fields
from grammars.text.overrides import Override, key_paths
from grammars.text.quantity import QuantityField, read_quantity, unit_of
from grammars.text.sources import is_jsonld

_SLOT_WORDS: Final = ("mission", "robot", "sut", "floorplan", "vary")
"""Slots with one layer, whose names may replace that of the layer."""
_KINDS: Final = {"objects": "layer", "behaviours": "layer", "sut": "system under test"}


@dataclass(frozen=True, slots=True)
class LayerValue:
    """Value under a ``key`` of a layer: a number in ``unit``, or a word.

    ``value`` is ``None`` if it is drawn or left out. ``text`` is the value as written at ``where``.
    ``whole`` values are integers.
    """

    key: str
    text: str
    value: float | str | None
    where: Where
    unit: str = ""
    whole: bool = False

    def in_unit(self, unit: str) -> float | None:
        """Return the number in another unit; ``None`` for words, and without a value."""
        if self.value is None or isinstance(self.value, str):
            return None
        return float(f"{self.value * _factor(self.unit) / _factor(unit):.12g}")

    @property
    def identity(self) -> float | str | None:
        """A key that is equal for equal values, numbers to nine digits."""
        return float(f"{self.value:.9g}") if isinstance(self.value, float) else self.value


def _factor(unit: str) -> float:
    return read_quantity(f"1 {unit}").value if unit else 1.0


@dataclass(frozen=True, slots=True)
class SearchLayer:
    """A layer of the searched scenario; ``label`` is its name in ``over``."""

    library: LayerLibrary
    reference: LayerReference
    slot: ParameterSlot
    index: int

    @property
    def label(self) -> str:
        """Name of the layer; for a path the name of the file."""
        return Path(self.reference.name).name.partition(".")[0]

    @property
    def labels(self) -> tuple[str, ...]:
        """All names of the layer."""
        return (self.label, self.slot) if self.slot in _SLOT_WORDS else (self.label,)

    @property
    def title(self) -> str:
        """Name of the layer in messages."""
        return f"{_KINDS.get(self.slot, self.slot)} {self.label}"

    def key_of(self, name: str) -> str:
        """Return ``KEY`` of ``LAYER.KEY``; empty for a name of another layer."""
        heads = (f"{label}." for label in self.labels)
        return next((name[len(head) :] for head in heads if name.startswith(head)), "")

    def value_of(self, name: str) -> LayerValue | None:
        """Return the value of ``LAYER.KEY``; ``None`` if this layer has no such value."""
        key = self.key_of(name)
        return self.find(key) if key else None

    def find(self, key: str) -> LayerValue | None:
        """Return the value of a key: dashes may stand for ``_``, slashes for dots."""
        dotted = key.strip("/").replace("/", ".")
        spellings = dict.fromkeys((key, dotted, dotted.replace("-", "_")))
        values = (value_at(self.library, self.slot, self.reference, one) for one in spellings)
        return next((value for value in values if value is not None), None)

    def changed(self, key: str, value: object, where: Where) -> LayerValue | None:
        """Return the value of a key after ``value`` is written under it, at ``where``.

        Raises :class:`InputError`, as the layer would for a campaign with this override.
        """
        reference = replace(self.reference.with_values({key: value}), where=where)
        return value_at(self.library, self.slot, reference, key)


def search_layers(
    library: LayerLibrary, scenario: ResolvedScenario, sut: int
) -> tuple[SearchLayer, ...]:
    """Return the layers of a loaded scenario with its ``sut``-th system under test."""
    plan: ParameterSlot = "vary" if scenario.vary else "floorplan"
    slots: list[tuple[ParameterSlot, Sequence[LayerReference | None]]] = [
        (plan, [scenario.vary.floorplan if scenario.vary else scenario.floorplan]),
        ("objects", scenario.objects),
        ("behaviours", scenario.behaviours),
        ("mission", [scenario.mission]),
        ("robot", [scenario.robot]),
    ]
    layers = [
        SearchLayer(library, required(reference), slot, index)
        for slot, references in slots
        for index, reference in enumerate(references)
    ]
    return (*layers, SearchLayer(library, scenario.suts[sut], "sut", sut))


def find_value(
    name: str, layers: Sequence[SearchLayer], where: Where, cell: CampaignCell
) -> tuple[SearchLayer, LayerValue]:
    """Return the value of a name in ``over``, and its layer.

    Raises :class:`InputError` for a name without a value, or with several.
    """
    matches = [(layer, value) for layer in layers if (value := layer.value_of(name)) is not None]
    if len(matches) == 1:
        return matches[0]
    if matches:
        places = " and ".join(f"{layer.title} ({value.where})" for layer, value in matches)
        slots = [layer.slot for layer, _ in matches if layer.slot in layer.labels]
        hint = f"write {slots[0]}.{matches[0][1].key}" if slots else "give one of them another name"
        raise InputError.at(where, f"{name} may be that of {places}", hint)
    near = [layer for layer in layers if layer.key_of(name)]
    if near:
        raise InputError([one for layer in near for one in _refusal(layer, name, where)])
    head = name.partition(".")[0]
    if head in {"oracles", *(oracle.name for oracle in cell.oracles)}:
        message = f"{name}: limits of oracles are not searched, they define success"
        raise InputError.at(where, message, "vary the scenario")
    if "." not in name:
        owners = [layer for layer in layers if layer.find(name) is not None]
        labels = ", ".join(dict.fromkeys(layer.label for layer in layers))
        hint = f"write LAYER.PARAMETER; its layers: {labels}"
        hint = f"write {owners[0].label}.{name}" if owners else hint
        raise InputError.at(where, f'"{name}" names no layer', hint)
    hint = did_you_mean(head, dict.fromkeys(label for layer in layers for label in layer.labels))
    raise InputError.at(where, f'{cell.name} has no layer "{head}"', hint)


def _refusal(layer: SearchLayer, name: str, where: Where) -> Sequence[Finding]:
    """Return the reason why a layer has no value of a name."""
    key = layer.key_of(name)
    try:
        layer.changed(key, 0, where)
    except InputError as error:
        return error.findings
    # Systems under test take parameters outside their files; a search begins at a written value.
    settings = layer.library.loaded_sut(layer.reference).settings
    hint = did_you_mean(key, [".".join(path) for path in settings])
    message = f"{layer.title} has no value of {key}"
    return [Finding(where, message, hint or "write it into the file first")]


def value_at(
    library: LayerLibrary, slot: ParameterSlot, reference: LayerReference, key: str
) -> LayerValue | None:
    """Return the value of a dotted key in a layer with its overrides; ``None`` without one.

    Raises :class:`InputError` for a layer that cannot be used.
    """
    match slot:
        case "floorplan":
            return _in_plan(library, reference, key)
        case "vary":
            return _in_variation(library, reference, key)
        case "objects" | "behaviours":
            return _in_scenery(library, reference, key)
        case "mission":
            return _in_document(library.mission(reference)[1], MissionText, key)
        case "robot":
            return _in_document(library.robot_file(reference)[1], RobotText, key)
        case "sut":
            return _in_sut(library, reference, key)


def _in_scenery(library: LayerLibrary, reference: LayerReference, key: str) -> LayerValue | None:
    layer = library.configured_scenery(reference)
    for parameter in layer.parameters:
        if parameter.name == key:
            default = parameter.value
            unit = _plain_unit(default.dimension)
            return LayerValue(key, default.text, default.value, parameter.where, unit)
    groups = (group for group in layer.groups if group.name == key)
    return next((LayerValue(key, str(g.members), str(g.members), g.where) for g in groups), None)


def _in_plan(library: LayerLibrary, reference: LayerReference, key: str) -> LayerValue | None:
    library.floorplan(reference)
    path = find_layer(library.folder, reference, FLOORPLAN)
    if path.name.endswith(WALLS_ENDING) or is_jsonld(path):
        return None
    overrides = {one.key.replace("-", "_"): one for one in reference.values}
    for variable in library.plan_text(path).variables:
        if variable.name == key:
            text, value, where = variable.text, variable.value, variable.where
            if key in overrides:
                text, where = str(overrides[key].value), overrides[key].where
                value = read_quantity(text).value
            return LayerValue(key, text, value, where, _plain_unit(variable.dimension))
    return None


def _in_variation(library: LayerLibrary, reference: LayerReference, key: str) -> LayerValue | None:
    from grammars.variation import Fixed, draw_unit

    path = find_layer(library.folder, reference, VARIATION)
    variation = library.fixed_variation(reference, path)
    for draw in variation.draws:
        if draw.name == key:
            unit, distribution = draw_unit(variation, draw), draw.distribution
            if not isinstance(distribution, Fixed):
                return LayerValue(key, "", None, draw.where, unit)
            text = f"{distribution.value:.10g} {unit}".rstrip()
            return LayerValue(key, text, distribution.value, draw.where, unit)
    return None


def _in_sut(library: LayerLibrary, reference: LayerReference, key: str) -> LayerValue | None:
    loaded = library.loaded_sut(reference)
    default = stack_kind(loaded.reference.kind).defaults().get(key)
    for path, setting in loaded.settings.items():
        if ".".join(path).replace("/", ".") == key:
            value = _plain_value(key, setting.value, setting.where)
            return replace(value, whole=value.whole and not isinstance(default, float))
    return None if default is None else _plain_value(key, default, reference.where)


def _in_document(document: YamlDocument, model: type[StrictModel], key: str) -> LayerValue | None:
    """Return the value of a key of a file, written or default."""
    try:
        *above, name = key_paths(document.data, Override(key, None, document.where()))[0]
    except InputError:
        return None
    node: Any = read_model(document, model)
    for part in above:
        node = node[part] if isinstance(part, int) else getattr(node, part, None)
    field = written_fields(type(node)).get(str(name))
    inside = getattr(node, str(name), None)
    # A section or a list is not a value; the file itself refuses a number in its place.
    if field is None or written_fields(type(inside)) or isinstance(inside, list):
        return None
    path: KeyPath = (*above, name)
    entry: Any = document.data
    for part in path:
        entry = entry[part] if isinstance(part, int) else (entry or {}).get(part)
    value = _plain_value(key, getattr(node, str(name)), document.where(path))
    mark = next(_quantities(field), None)
    return replace(
        value,
        text=value.text if entry is None else str(entry),
        unit=_plain_unit(mark.dimension) if mark else "",
    )


def _quantities(field: FieldInfo) -> Iterator[QuantityField]:
    inner = (m for part in get_args(field.annotation) for m in getattr(part, "__metadata__", ()))
    return (mark for mark in (*field.metadata, *inner) if isinstance(mark, QuantityField))


def _plain_value(key: str, value: Any, where: Where) -> LayerValue:
    """Return a number, a truth value or a word, as written in a file without a unit."""
    if isinstance(value, bool):
        return LayerValue(key, str(value).lower(), str(value).lower(), where)
    if isinstance(value, int | float):
        return LayerValue(key, f"{value:.10g}", float(value), where, whole=isinstance(value, int))
    return LayerValue(key, "" if value is None else str(value), value and str(value), where)


def _plain_unit(dimension: str) -> str:
    unit = unit_of(dimension)
    return "" if unit == "1" else unit


_PRECISION: Final = {"time": 0.01, "length": 0.001, "angle": math.radians(0.1)}
"""Sensible precision [SI] of times, lengths and angles: a door is not set to the millisecond."""
_FEWEST: Final = 20
"""Least number of steps of a range."""


def step_of(low: float, high: float, unit: str, *, log: bool, whole: bool) -> float:
    """Return the step of a range from ``low`` to ``high``, a power of ten in its ``unit``.

    It is 0.01 s, 1 mm or 0.1 deg, as a decimal of the written unit. For other quantities and
    smaller ranges it is a hundredth to a thousandth of the range, for ``whole`` numbers 1. A
    logarithmic range may need a finer step for its smallest values. Values are rounded to the step
    before a run, so that near-duplicates are one run.
    """
    if whole:
        return 1.0
    step = _power_of_ten((high - low) / 1000.0)
    if unit:
        one = read_quantity(f"1 {unit}")
        precision = _PRECISION.get(one.dimension)
        if precision is not None:
            step = _power_of_ten(precision / one.value)
            if round((high - low) / step, 6) < _FEWEST:
                step = _power_of_ten((high - low) / 100.0)
    return min(step, _power_of_ten(low / 10.0)) if log else step


def _power_of_ten(number: float) -> float:
    """Return the largest power of ten that is not above ``number``."""
    # The logarithm of 0.1 may be just below -1.
    return float(f"1e{math.floor(round(math.log10(number), 9))}")
