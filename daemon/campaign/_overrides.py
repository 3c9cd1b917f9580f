"""Scenarios with other values beside the names of their layers."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from typing import Any, Final

from daemon.campaign._scenarios import LayerReference, ResolvedScenario
from daemon.model.search import ParameterSlot

_LISTS: Final = {"objects": "objects", "behaviours": "behaviours", "sut": "suts"}
"""Slots that hold several layers, by the key people write."""


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
