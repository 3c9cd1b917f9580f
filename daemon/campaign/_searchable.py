"""What may be searched: the layers of a scenario with the values that have a name in them."""

from __future__ import annotations

import re
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Final

from daemon.campaign._layers import LayerLibrary
from daemon.campaign._overrides import (
    OverridableValue,
    find_overridable,
    layer_at,
    overridable,
)
from daemon.campaign._scenarios import LayerReference, ResolvedScenario
from daemon.campaign._search_file import ValueChoices, ValueRange
from daemon.model.search import ParameterSlot
from grammars.scenery import values_in
from grammars.scenery.measure import Measure
from grammars.scenery.model import Sentence
from grammars.text.quantity import read_quantity

SLOT_WORDS: Final = ("mission", "robot", "sut", "floorplan", "vary")
"""Slots with one layer, which may be named in the place of that layer."""
_KINDS: Final = {"objects": "layer", "behaviours": "layer", "sut": "system under test"}


@dataclass(frozen=True, slots=True)
class SearchLayer:
    """A layer of a scenario that is searched, and the values that have a name in it.

    ``label`` is what it is called in ``over``; ``sentences`` are there for a scenery layer.
    """

    slot: ParameterSlot
    index: int
    label: str
    values: Mapping[str, OverridableValue]
    sentences: tuple[Sentence, ...] = ()
    file: str = ""

    @property
    def labels(self) -> tuple[str, ...]:
        """All that it may be called."""
        return (self.label, self.slot) if self.slot in SLOT_WORDS else (self.label,)

    @property
    def title(self) -> str:
        """What messages call it."""
        return f"{_KINDS.get(self.slot, self.slot)} {self.label}"

    def key_of(self, name: str) -> str:
        """Return what stands behind the layer in ``LAYER.KEY``; empty for another layer's."""
        heads = (f"{label}." for label in self.labels)
        return next((name[len(head) :] for head in heads if name.startswith(head)), "")

    def value_of(self, name: str) -> OverridableValue | None:
        """Return the value that ``LAYER.KEY`` means here; ``None`` where there is none."""
        key = self.key_of(name)
        return find_overridable(self.values, key) if key else None


def search_layers(
    library: LayerLibrary, scenario: ResolvedScenario, sut: int
) -> tuple[SearchLayer, ...]:
    """Return the layers of a loaded scenario with its ``sut``-th system under test."""
    plan: ParameterSlot = "floorplan" if scenario.vary is None else "vary"
    slots: list[tuple[ParameterSlot, int]] = [(plan, 0)]
    slots += [("objects", index) for index in range(len(scenario.objects))]
    slots += [("behaviours", index) for index in range(len(scenario.behaviours))]
    slots += [("mission", 0), ("robot", 0), ("sut", sut)]
    return tuple(_search_layer(library, scenario, slot, index) for slot, index in slots)


def _search_layer(
    library: LayerLibrary, scenario: ResolvedScenario, slot: ParameterSlot, index: int
) -> SearchLayer:
    reference = layer_at(scenario, slot, index)
    values = overridable(library, scenario, slot, index)
    if slot not in ("objects", "behaviours"):
        return SearchLayer(slot, index, _label(reference), values)
    layer = library.scenery(reference)
    return SearchLayer(slot, index, _label(reference), values, layer.sentences, layer.file)


def _label(reference: LayerReference) -> str:
    """Return what people call a layer: its name, of a path the name of the file."""
    return Path(reference.name).name.partition(".")[0]


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
        for measure in (one for one in values_in(sentence) if isinstance(one, Measure)):
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
