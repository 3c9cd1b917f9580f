"""One scenario of a campaign as a campaign file of its own, beside the one it comes from."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

from daemon.campaign._campaign import Campaign
from daemon.campaign._scenarios import LayerReference, PlanVariation, ResolvedScenario
from grammars.text.yaml_text import comment_text, yaml_text


def campaign_text(
    campaign: Campaign,
    scenario: ResolvedScenario,
    *,
    name: str,
    sut: int | None = None,
    repeats: int = 1,
    about: str = "",
    comment: str = "",
    expect: Sequence[Mapping[str, Any]] = (),
) -> str:
    """Return a campaign file for the folder of ``campaign`` with one scenario alone.

    It says everything itself: what the scenario inherits, and the values beside layer names. Its
    runs are those of ``campaign``, digest by digest, where the scenario is called ``name`` there.
    ``sut`` is the number of a system under test of the scenario, ``None`` for all of them.
    Comparisons are about several scenarios: neither they are there nor what they measure on legs.
    """
    suts = scenario.suts if sut is None else (scenario.suts[sut],)
    head: dict[str, Any] = {
        "campaign": campaign.name,
        "about": about,
        "seed": campaign.seed,
        "repeats": repeats,
        "limit": _quantity(scenario.limit, "s"),
        "robot": _named(scenario.robot),
        "matrix": {"sut": _list(suts)},
        "oracles": list(campaign.oracle_layers),
        "map": _map(scenario),
        "scenarios": {name: _slots(scenario)},
        "expect": [dict(one) for one in expect],
    }
    return comment_text(comment) + yaml_text(_filled(head), plain=True)


def _slots(scenario: ResolvedScenario) -> dict[str, Any]:
    slots = {
        "about": scenario.about,
        "floorplan": _named(scenario.floorplan),
        "vary": _vary(scenario.vary),
        "objects": _list(scenario.objects),
        "behaviours": _list(scenario.behaviours),
        "mission": _named(scenario.mission),
        "without": _list(scenario.without),
        "oracles": _list(scenario.oracles),
        "chance": scenario.chance,
    }
    return _filled(slots)


def _filled(tree: Mapping[str, Any]) -> dict[str, Any]:
    return {key: value for key, value in tree.items() if value not in (None, "", [], {})}


def _named(reference: LayerReference | None) -> Any:
    return None if reference is None else reference.as_written()


def _list(references: Sequence[LayerReference]) -> list[Any]:
    return [_named(reference) for reference in references]


def _vary(vary: PlanVariation | None) -> dict[str, Any] | None:
    if vary is None:
        return None
    samples = {} if vary.samples is None else {"samples": vary.samples}
    return {"floorplan": _named(vary.floorplan), **samples, "cover": vary.cover, "seed": vary.seed}


def _map(scenario: ResolvedScenario) -> dict[str, str]:
    if scenario.map_file is not None:
        return {"file": scenario.map_file.name}
    settings = scenario.map
    return {
        "resolution": _quantity(settings.resolution, "m"),
        "doors": settings.doors,
        "rule": settings.rule,
    }


def _quantity(value: float, unit: str) -> str:
    """Return a quantity that reads back as the very same value."""
    return f"{repr(value).removesuffix('.0')} {unit}"
