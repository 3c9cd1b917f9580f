"""What may be given another value beside the name of a layer, and scenarios with such values."""

from __future__ import annotations

import types
import typing
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, replace
from typing import Any, Final, Literal

from pydantic import BaseModel
from pydantic.fields import FieldInfo

from daemon.campaign._layers import FLOORPLAN, VARIATION, LayerLibrary, find_layer
from daemon.campaign._scenarios import LayerReference, ResolvedScenario
from daemon.model.search import ParameterSlot
from daemon.stacks.registry import stack_kind
from grammars.floorplan import WALLS_ENDING
from grammars.jsonld import is_jsonld
from grammars.model.mission_files import MissionText
from grammars.model.robot_files import RobotText
from grammars.scenery import SceneryLayer
from grammars.text.diagnostics import Where
from grammars.text.documents import KeyPath, QuantityField, YamlDocument
from grammars.text.overrides import item_names
from grammars.text.quantity import read_quantity
from grammars.text.units import SI_UNITS

_LISTS: Final = {"objects": "objects", "behaviours": "behaviours", "sut": "suts"}
"""Slots that hold several layers, by the key people write."""
_IDLE: Final[dict[type[BaseModel], frozenset[str]]] = {
    MissionText: frozenset({"about", "mission", "id", "z", "roll", "pitch"}),
    RobotText: frozenset({"about", "robot", "name"}),
}
"""Keys that name things or are read and ignored: no run depends on them."""


@dataclass(frozen=True, slots=True)
class OverridableValue:
    """Something of a layer that may have another value beside the name of the layer.

    ``value`` is what the scenario has, in SI units, as ``text`` would write it; ``None`` where it
    is drawn or nobody says it. ``unit`` is the SI unit of what has a ``dimension``; without one it
    is a plain number or text, or nothing is known about it. A ``plain`` one may be written as a
    number without a unit, ``whole`` ones are counted, ``choices`` are all there are.
    """

    key: str
    text: str
    value: float | str | None
    where: Where
    dimension: str = ""
    plain: bool = True
    whole: bool = False
    choices: tuple[str, ...] = ()

    @property
    def unit(self) -> str:
        """The SI unit, empty for plain numbers and text."""
        unit = SI_UNITS.get(self.dimension, "")
        return "" if unit == "1" else unit


def layer_at(scenario: ResolvedScenario, slot: ParameterSlot, index: int = 0) -> LayerReference:
    """Return the layer a scenario names in a slot; raises ``ValueError`` when there is none."""
    if slot == "vary":
        found = [scenario.vary.floorplan] if scenario.vary else []
    elif slot in _LISTS:
        found = list(getattr(scenario, _LISTS[slot]))
    else:
        found = [named for named in (getattr(scenario, slot),) if named is not None]
    if not 0 <= index < len(found):
        raise ValueError(f"{scenario.name} has no layer {index} in {slot}")
    layer: LayerReference = found[index]
    return layer


def with_overrides(
    scenario: ResolvedScenario, slot: ParameterSlot, index: int, values: Mapping[str, object]
) -> ResolvedScenario:
    """Return a scenario with other values beside the ``index``-th layer name of a slot.

    They win over those that are written there. Raises ``ValueError`` when there is no such layer.
    """
    before = layer_at(scenario, slot, index)
    # The last one that is said of a key holds, also where it is spelled in two ways.
    kept = {key: value for key, value in before.overrides.items() if key not in values}
    places = {path: where for path, where in before.places.items() if path[0] in kept}
    changed = replace(before, overrides={**kept, **values}, places=places)
    if slot == "vary":
        assert scenario.vary is not None
        return replace(scenario, vary=replace(scenario.vary, floorplan=changed))
    if slot in _LISTS:
        name = _LISTS[slot]
        layers = list(getattr(scenario, name))
        layers[index] = changed
        change: dict[str, Any] = {name: tuple(layers)}
    else:
        change = {slot: changed}
    return replace(scenario, **change)


def overridable(
    library: LayerLibrary, scenario: ResolvedScenario, slot: ParameterSlot, index: int = 0
) -> dict[str, OverridableValue]:
    """Return what may be overridden in a layer of a scenario, by its dotted key.

    Values are those with the overrides that are written. Of systems under test these are the
    parameters that are written somewhere, of the pilot all. Raises :class:`InputError` for a
    layer that cannot be used, ``ValueError`` when there is no such layer.
    """
    reference = layer_at(scenario, slot, index)
    match slot:
        case "floorplan":
            found = _of_plan(library, reference)
        case "vary":
            found = _of_variation(library, reference)
        case "objects" | "behaviours":
            found = _of_scenery(library.configured_scenery(reference))
        case "mission":
            _, document = library.mission(reference)
            found = _of_document(document, MissionText)
        case "robot":
            _, document = library.robot_file(reference)
            found = _of_document(document, RobotText)
        case "sut":
            found = _of_sut(library, reference)
    return {value.key: value for value in found}


def find_overridable(values: Mapping[str, OverridableValue], key: str) -> OverridableValue | None:
    """Return the value that a key means: dashes may stand for ``_``, slashes for dots."""
    dotted = key.strip("/").replace("/", ".")
    return next((values[k] for k in (key, dotted, dotted.replace("-", "_")) if k in values), None)


def _of_scenery(layer: SceneryLayer) -> Iterator[OverridableValue]:
    for parameter in layer.parameters:
        said = parameter.value
        plain = said.dimension == "ratio"
        yield OverridableValue(
            parameter.name, said.text, said.value, parameter.where, said.dimension, plain
        )
    for group in layer.groups:
        yield OverridableValue(group.name, str(group.members), str(group.members), group.where)


def _of_plan(library: LayerLibrary, reference: LayerReference) -> Iterator[OverridableValue]:
    path = find_layer(library.folder, reference, FLOORPLAN)
    library.floorplan(reference)
    if path.name.endswith(WALLS_ENDING) or is_jsonld(path):
        return
    given = {override.key.replace("-", "_"): override for override in reference.values}
    for variable in library.plan_text(path).variables:
        text, value, where = variable.text, variable.value, variable.where
        if variable.name in given:
            said = given[variable.name]
            text, value, where = str(said.value), read_quantity(str(said.value)).value, said.where
        yield OverridableValue(variable.name, text, value, where, variable.dimension, False)


def _of_variation(library: LayerLibrary, reference: LayerReference) -> Iterator[OverridableValue]:
    from grammars.variation import Fixed, draw_unit

    path = find_layer(library.folder, reference, VARIATION)
    variation = library.variation(path)
    for draw in library.fixed_variation(reference, path).draws:
        unit = draw_unit(variation, draw)
        quantity = read_quantity(f"1 {unit}") if unit else None
        dimension = quantity.dimension if quantity else ""
        number = draw.distribution.value if isinstance(draw.distribution, Fixed) else None
        text = "" if number is None else f"{number:.10g} {unit}".rstrip()
        value = number if number is None or not quantity else number * quantity.value
        # A plain number is in the unit of the draw, which need not be the SI unit.
        plain = not quantity or SI_UNITS[dimension] == unit
        yield OverridableValue(draw.name, text, value, draw.where, dimension, plain)


def _of_sut(library: LayerLibrary, reference: LayerReference) -> Iterator[OverridableValue]:
    loaded = library.loaded_sut(reference)
    defaults, written = stack_kind(loaded.reference.kind).defaults(), set()
    for path, setting in loaded.settings.items():
        value = setting.value
        key = ".".join(path).replace("/", ".")
        written.add(key)
        number = isinstance(value, int | float) and not isinstance(value, bool)
        choices = ("true", "false") if isinstance(value, bool) else ()
        yield OverridableValue(
            key,
            str(value).lower() if choices else str(value),
            float(value) if number else str(value).lower() if choices else str(value),
            setting.where,
            whole=isinstance(value, int) and number and not isinstance(defaults.get(key), float),
            choices=choices,
        )
    for name, default in defaults.items():
        if name not in written:
            yield _default(name, default, reference.where)


def _default(key: str, value: Any, where: Where) -> OverridableValue:
    number = isinstance(value, int | float) and not isinstance(value, bool)
    return OverridableValue(
        key,
        f"{value:g}" if number else str(value),
        float(value) if number else str(value),
        where,
        whole=isinstance(value, int) and number,
    )


def _of_document(document: YamlDocument, model: type[BaseModel]) -> Iterator[OverridableValue]:
    for value in _of_model(document, model, document.data, (), ()):
        if value.key.rpartition(".")[2] not in _IDLE[model]:
            yield value


def _of_model(
    document: YamlDocument, model: type[BaseModel], data: Any, path: KeyPath, words: tuple[str, ...]
) -> Iterator[OverridableValue]:
    """Yield the values of a mapping, written or not; ``words`` are the keys that lead there."""
    for name, field in model.model_fields.items():
        key = field.alias or name
        written = data.get(key) if isinstance(data, Mapping) else None
        inner, below, said = _model_of(field.annotation), (*path, key), (*words, key)
        if inner is None:
            yield _leaf(document, field, written, below, said)
        elif isinstance(written, list):
            names = item_names(written, key)
            for index, (item, item_name) in enumerate(zip(written, names, strict=True)):
                yield from _of_model(document, inner, item, (*below, index), (*said, item_name))
        elif isinstance(written, Mapping):
            # What is not written has parts that must be: it is written as a whole.
            yield from _of_model(document, inner, written, below, said)


def _leaf(
    document: YamlDocument, field: FieldInfo, written: Any, path: KeyPath, words: tuple[str, ...]
) -> OverridableValue:
    quantity = next(_quantities((*field.metadata, field.annotation)), None)
    default: Any = None if field.is_required() else field.get_default()
    text = "" if written is None else str(written)
    number: float | str | None = None
    if quantity is not None and written is not None:
        number = quantity.read(written)
    elif quantity is not None and default is not None:
        unit = "" if quantity.plain else SI_UNITS[quantity.dimension].replace("1", "")
        number, text = float(default), f"{default:g} {unit}".rstrip()
    elif written is not None or default is not None:
        value = default if written is None else written
        plain = isinstance(value, int | float) and not isinstance(value, bool)
        number, text = (float(value) if plain else str(value)), str(value)
    return OverridableValue(
        ".".join(words),
        text,
        number,
        document.where(path),
        quantity.dimension if quantity else "",
        plain=quantity is None or quantity.plain or quantity.dimension == "ratio",
        whole=_bare(field.annotation) is int,
        choices=_choices(field.annotation),
    )


def _quantities(parts: tuple[Any, ...]) -> Iterator[QuantityField]:
    for part in parts:
        if isinstance(part, QuantityField):
            yield part
        elif typing.get_origin(part) in (typing.Annotated, typing.Union, types.UnionType):
            yield from _quantities((*typing.get_args(part), *getattr(part, "__metadata__", ())))


def _members(annotation: Any) -> tuple[Any, ...]:
    """Return what an annotation may be, without ``None`` and ``Annotated``."""
    origin = typing.get_origin(annotation)
    if origin is typing.Annotated:
        return _members(typing.get_args(annotation)[0])
    if origin in (typing.Union, types.UnionType):
        return tuple(m for part in typing.get_args(annotation) for m in _members(part))
    return () if annotation is type(None) else (annotation,)


def _bare(annotation: Any) -> Any:
    members = _members(annotation)
    return members[0] if len(members) == 1 else None


def _model_of(annotation: Any) -> type[BaseModel] | None:
    """Return the model of keys that a field holds, one or a list of them."""
    bare = _bare(annotation)
    if typing.get_origin(bare) is list:
        bare = _bare(typing.get_args(bare)[0])
    return bare if isinstance(bare, type) and issubclass(bare, BaseModel) else None


def _choices(annotation: Any) -> tuple[str, ...]:
    bare = _bare(annotation)
    return tuple(map(str, typing.get_args(bare))) if typing.get_origin(bare) is Literal else ()
