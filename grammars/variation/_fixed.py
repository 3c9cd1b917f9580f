"""Draws of a variation that a campaign fixes: each has one value, everything else varies on."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from typing import Any

from grammars.text.diagnostics import Finding, InputError, Where, did_you_mean, with_article
from grammars.text.quantity import parse_quantity
from grammars.text.units import DIMENSIONS, RATIO, from_si, read_unit
from grammars.variation._distributions import Fixed
from grammars.variation._load import Variation, VariationDraw


def draw_unit(variation: Variation, draw: VariationDraw) -> str:
    """Return the unit a draw is in, written or that of what it is for; empty for plain numbers."""
    if draw.unit:
        return draw.unit
    slots = (a.slot for a in variation.assignments if a.source == draw.name)
    return next((slot.unit for slot in slots), "")


def fix_draws(
    variation: Variation, values: Mapping[str, Any], where: Where, places: Mapping[str, Where]
) -> Variation:
    """Return a variation some of whose draws have one value each, as somebody wrote it.

    A number is in the unit of the draw, as in the file itself. ``places`` says where each is
    written, ``where`` where all of them are. Raises :class:`InputError` with all that do not fit.
    """
    draws = {draw.name: draw for draw in variation.draws}
    findings: list[Finding] = []
    for key, value in values.items():
        place = places.get(key, where)
        name = key if key in draws else key.replace("-", "_")
        if name not in draws:
            findings.append(_unknown(variation, key, place))
            continue
        try:
            number = _number(value, draw_unit(variation, draws[name]), name, place)
        except InputError as error:
            findings.extend(error.findings)
            continue
        drawn = draws[name].distribution
        drawn = drawn.drawn if isinstance(drawn, Fixed) else drawn
        draws[name] = replace(draws[name], distribution=Fixed(number, drawn))
    if findings:
        raise InputError(findings)
    return replace(variation, draws=tuple(draws.values()))


def _unknown(variation: Variation, key: str, where: Where) -> Finding:
    names = [draw.name for draw in variation.draws]
    message = f'variation of {variation.plan_name} has no draw "{key}"'
    if key in variation.reported:
        hint = f"it is calculated; what is drawn: {', '.join(names)}"
        return Finding(where, message, hint)
    return Finding(where, message, did_you_mean(key, names))


def _number(value: Any, unit: str, name: str, where: Where) -> float:
    """Return a value in the unit of its draw; raises :class:`InputError`."""
    if not isinstance(value, str | int | float) or isinstance(value, bool):
        message = f"{name} is one value, not {value}"
        raise InputError.at(where, message, f"write {name}: 1 {unit}".rstrip())
    quantity = parse_quantity(str(value), where)
    given = DIMENSIONS[quantity.dimension]
    if given == RATIO:
        return quantity.value
    if given != read_unit(unit)[1]:
        wanted = f"in {unit}" if unit else "a plain number"
        message = f"{name} is {wanted}, not {with_article(quantity.dimension)}"
        raise InputError.at(where, message, f"write {name}: 1 {unit}".rstrip())
    return from_si(quantity.value, unit)
