"""What a name in a search means: the value of a layer, and that value in the unit of a range."""

from __future__ import annotations

import re
from collections.abc import Sequence

from daemon.campaign._cells import CampaignCell
from daemon.campaign._overrides import OverridableValue
from daemon.campaign._search_file import ValueChoices, ValueRange
from daemon.campaign._searchable import SearchLayer, literal_hint
from daemon.model.search import PointValue
from grammars.text.diagnostics import InputError, Where, closest, did_you_mean
from grammars.text.quantity import read_quantity


def find_value(
    name: str,
    layers: Sequence[SearchLayer],
    over: ValueRange | ValueChoices,
    where: Where,
    cell: CampaignCell,
) -> tuple[SearchLayer, OverridableValue]:
    """Return what a name in ``over`` means; raises :class:`InputError` saying what it may be."""
    found = [(layer, value) for layer in layers if (value := layer.value_of(name)) is not None]
    if len(found) == 1:
        return found[0]
    if found:
        places = " and ".join(f"{layer.title} ({value.where})" for layer, value in found)
        slots = [layer.slot for layer, _ in found if layer.slot in layer.labels]
        hint = f"write {slots[0]}.{found[0][1].key}" if slots else "give one of them another name"
        raise InputError.at(where, f"{name} may be that of {places}", hint)
    near = [(layer, key) for layer in layers if (key := layer.key_of(name))]
    if near:
        layer, key = near[0]
        titles = " nor ".join(layer.title for layer, _ in near)
        message = f'{titles} has no parameter "{key}"'
        known = [known for layer, _ in near for known in layer.values]
        hint = literal_hint(layer, key, over, named=bool(closest(key, known)))
        hint = hint or did_you_mean(key, known)
        raise InputError.at(where, message, hint)
    head = name.partition(".")[0]
    oracles = {oracle.name for oracle in cell.oracles}
    if head in oracles or head == "oracles":
        message = f"{name}: limits of oracles are not searched, they say what is good"
        raise InputError.at(where, message, "vary the scenario")
    if "." not in name:
        known = [f"{layer.label}.{key}" for layer in layers for key in layer.values if key == name]
        hint = f"write {known[0]}" if known else _layers_hint(layers)
        raise InputError.at(where, f'"{name}" names no layer', hint)
    labels = dict.fromkeys(label for layer in layers for label in layer.labels)
    hint = did_you_mean(head, labels)
    raise InputError.at(where, f'{cell.name} has no layer "{head}"', hint)


def _layers_hint(layers: Sequence[SearchLayer]) -> str:
    return f"write LAYER.PARAMETER; its layers: {', '.join(dict.fromkeys(x.label for x in layers))}"


def is_number(value: OverridableValue) -> bool:
    """Return whether something may be a number: it is one, or nobody says what it is."""
    return bool(value.dimension) or not (isinstance(value.value, str) or value.choices)


def require_dimension(name: str, unit: str, value: OverridableValue, where: Where) -> None:
    """Raise :class:`InputError` where a range is in a unit that its parameter cannot be in."""
    given = read_quantity(f"1 {unit}").dimension if unit else "ratio"
    if given == (value.dimension or "ratio") or (not unit and value.plain):
        return
    wanted = f"in {value.unit}" if value.unit else "a plain number"
    has = f"is in {unit}" if unit else "has no unit"
    message = f"{name} is {wanted}, its range {has}"
    raise InputError.at(where, message, f"it is written at {value.where}: {value.text}")


def in_unit(value: OverridableValue, unit: str) -> float | None:
    """Return the written number in the unit of a range."""
    number = number_of(value)
    if number is None:
        return None
    given = re.fullmatch(r"\s*([-+0-9.eE]+)\s*(.*?)\s*", value.text)
    if given is not None and " ".join(given[2].split()) == unit:
        return float(given[1])  # exactly as written, without a detour by SI units
    factor = read_quantity(f"1 {unit}").value if unit else 1.0
    return float(f"{number / factor:.12g}")


def number_of(value: OverridableValue) -> float | None:
    """Return the value in SI units; ``None`` for words and for what is written nowhere."""
    return None if isinstance(value.value, str) else value.value


def choice_as_written(
    name: str, value: OverridableValue, over: ValueChoices, where: Where
) -> PointValue | None:
    """Return the choice that is the number as written, else that number in its own words."""
    same, written = None, number_of(value)
    numbers: dict[float, PointValue] = {}
    for choice in over.values:
        if isinstance(choice, str):
            try:
                quantity = read_quantity(choice)
            except ValueError as error:
                raise InputError.at(where, f"{name}: {error}") from error
            if quantity.dimension != (value.dimension or "ratio"):
                raise InputError.at(
                    where,
                    f'{name}: "{choice}" is in {quantity.unit}',
                    f"it is written at {value.where}: {value.text}",
                )
        elif not value.plain:
            hint = f"it is written at {value.where}: {value.text}"
            raise InputError.at(where, f"{name}: {choice:g} has no unit", hint)
        number = read_quantity(choice).value if isinstance(choice, str) else choice
        other = numbers.setdefault(float(f"{number:.9g}"), choice)
        if other != choice:
            message = f"{name}: {other} and {choice} are the same value"
            raise InputError.at(where, message, "leave one of them out")
        if written is not None and abs(number - written) <= 1e-9 * abs(number):
            same = choice
    words = isinstance(over.values[0], str)
    return same if same is not None else value.text if words else written
