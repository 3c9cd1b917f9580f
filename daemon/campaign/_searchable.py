"""What may be searched: the layers of a scenario with the values that have a name in them."""

from __future__ import annotations

import dataclasses
import re
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, Final, Literal

from daemon.campaign._layers import LayerLibrary
from daemon.campaign._scenarios import LayerReference, ResolvedScenario
from daemon.campaign._search_file import ValueChoices, ValueRange
from daemon.model.search import ParameterSlot
from grammars.scenery import SceneryLayer, configure
from grammars.scenery.model import Measure, Sentence
from grammars.text.diagnostics import Where
from grammars.text.quantity import read_quantity

SLOT_WORDS: Final = ("mission", "robot", "sut", "floorplan", "vary")
"""Slots with one layer, which may be named in the place of that layer."""


@dataclass(frozen=True, slots=True)
class WrittenValue:
    """A value that has a name: as it is written, in SI units where it is a number, and where.

    ``plain`` numbers are taken without a unit as well.
    """

    text: str
    number: float | None
    dimension: str
    where: Where
    kind: Literal["quantity", "whole", "names", "text", "truth"] = "quantity"
    plain: bool = False


@dataclass(frozen=True, slots=True)
class SearchLayer:
    """A layer of a scenario that is searched, and the values that have a name in it.

    ``label`` is what it is called in ``over``; ``sentences`` are there for a scenery layer.
    """

    slot: ParameterSlot
    index: int
    label: str
    values: Mapping[str, WrittenValue]
    sentences: tuple[Sentence, ...] = ()
    file: str = ""
    names: tuple[str, ...] = field(default=())

    @property
    def labels(self) -> tuple[str, ...]:
        """All that it may be called."""
        return (self.label, self.slot) if self.slot in SLOT_WORDS else (self.label,)

    @property
    def title(self) -> str:
        """What messages call it."""
        kind = {"objects": "layer", "behaviours": "layer", "sut": "system under test"}
        return f"{kind.get(self.slot, self.slot)} {self.label}"

    def key_of(self, name: str) -> str:
        """Return what stands behind the layer in ``LAYER.KEY``; empty for another layer's."""
        heads = (f"{label}." for label in self.labels)
        return next((name[len(head) :] for head in heads if name.startswith(head)), "")

    def written_key(self, key: str) -> str:
        """Return the key as the layer has it; empty where it does not."""
        # As in overrides of scenery: in YAML people write names with dashes.
        return next((one for one in (key, key.replace("-", "_")) if one in self.values), "")


def search_layers(
    library: LayerLibrary, scenario: ResolvedScenario, sut: int
) -> tuple[SearchLayer, ...]:
    """Return the layers of a loaded scenario with its ``sut``-th system under test."""
    found = []
    slots: tuple[tuple[ParameterSlot, tuple[LayerReference, ...]], ...] = (
        ("objects", scenario.objects),
        ("behaviours", scenario.behaviours),
    )
    for slot, references in slots:
        for index, reference in enumerate(references):
            plain = library.scenery(reference)
            layer = configure(plain, reference.overrides, reference.where)
            values = dict(_scenery_values(layer))
            label = _label(reference)
            found.append(SearchLayer(slot, index, label, values, layer.sentences, layer.file))
    return tuple(found)


def _label(reference: LayerReference) -> str:
    """Return what people call a layer: its name, of a path the name of the file."""
    return Path(reference.name).name.partition(".")[0]


def _scenery_values(layer: SceneryLayer) -> Iterator[tuple[str, WrittenValue]]:
    for parameter in layer.parameters:
        value = parameter.value
        yield (
            parameter.name,
            WrittenValue(value.text, value.value, value.dimension, parameter.where),
        )
    for group in layer.groups:
        names = ", ".join(map(str, group.members.names))
        yield group.name, WrittenValue(names, None, "", group.where, "names")


def literal_hint(
    layer: SearchLayer, key: str, over: ValueRange | ValueChoices, *, named: bool
) -> str:
    """Say how a quantity that stands in a sentence becomes a parameter, where one may be meant.

    That is the one nearest to the middle of the range, in a sentence about what ``key`` speaks of
    if there is one; ``named`` says that a parameter may be meant that is there.
    """
    if not isinstance(over, ValueRange) or not layer.sentences:
        return ""
    unit = read_quantity(f"1 {over.unit}") if over.unit else read_quantity("1")
    low, high = over.low * unit.value, over.high * unit.value
    words = set(re.split(r"[^a-z0-9]+", key.lower()))
    meant: list[tuple[int, float, Measure]] = []
    for sentence in layer.sentences:
        about = set(re.split(r"[^a-z0-9]+", str(sentence.subject).lower()))
        for measure in _measures(sentence):
            fits = measure.dimension == unit.dimension and low <= measure.value <= high
            if fits and (words & about or not named):
                off = abs(measure.value - (low + high) / 2.0)
                meant.append((-len(words & about), off, measure))
    if not meant:
        return ""
    literal = min(meant, key=lambda one: one[:2])[2]
    name = re.sub(r"\W+", "_", key)
    return (
        f"only what has a name is searched: write parameter {name} = {literal.text} into "
        f"{Path(layer.file).name}, and {name} in place of {literal.text} at {literal.where}"
    )


def _measures(part: Any) -> Iterator[Measure]:
    if isinstance(part, Measure):
        yield part
    elif isinstance(part, tuple | list):
        for one in part:
            yield from _measures(one)
    elif dataclasses.is_dataclass(part):
        for one in dataclasses.fields(part):
            yield from _measures(getattr(part, one.name))


def references_of(scenario: ResolvedScenario, slot: ParameterSlot) -> Sequence[LayerReference]:
    """Return the references of a slot, in order."""
    single = {
        "floorplan": scenario.floorplan,
        "vary": scenario.vary.floorplan if scenario.vary else None,
        "mission": scenario.mission,
        "robot": scenario.robot,
    }
    if slot in single:
        one = single[slot]
        return () if one is None else (one,)
    return {
        "objects": scenario.objects,
        "behaviours": scenario.behaviours,
        "sut": scenario.suts,
    }[slot]
