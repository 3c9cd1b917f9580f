"""Reading ``… is a …``: which object stands where."""

from __future__ import annotations

from typing import Any, Final

from grammars.diagnostics import Diagnostic, InputError
from grammars.scenery.model import At, FrameName, In, Instance, Name, Subject, Towards
from grammars.scenery.reader import Reader

_WORDS: Final = {
    "XIs": "x",
    "YIs": "y",
    "Turned": "turned",
    "Hinge": "hinge",
    "Sliding": "sliding",
    "Opening": "opening",
    "OnSide": "on the",
    "Recessed": "recessed",
}


def read_instance(reader: Reader, subject: Subject, node: Any) -> Instance:
    """Return the instance of a ``… is a …`` sentence."""
    if subject.every or len(subject.names) != 1 or subject.exceptions or subject.names[0].joint:
        hint = "door_1 is a hinged_door at …"
        raise InputError(Diagnostic(subject.where, "one object is placed at a time", hint))
    options = reader.once(node.options)
    starts = options.pop("StartsIn", None)
    frozen = options.pop("FrozenOption", None) is not None
    read = _at if type(node.place).__name__ == "At" else _in
    return Instance(
        subject.names[0].object,
        reader.name(node.model),
        read(reader, node.place, options),
        None if starts is None else reader.amount(starts.position, "angle", "length"),
        frozen,
        subject.where,
    )


def _at(reader: Reader, node: Any, options: dict[str, Any]) -> At:
    at = _offsets(reader, options)
    _refuse(reader, options, "is for objects placed in an entryway", "write in <entryway>, …")
    return At(reader.frame(node.frame), *at)


def _offsets(reader: Reader, options: dict[str, Any]) -> tuple[float, float, float]:
    return (
        _value(reader, options.pop("XIs", None), "length"),
        _value(reader, options.pop("YIs", None), "length"),
        _value(reader, options.pop("Turned", None), "angle"),
    )


def _in(reader: Reader, node: Any, options: dict[str, Any]) -> At | In:
    entryway = reader.name(node.entryway)
    offsets = [kind for kind in options if kind in ("XIs", "YIs")]
    if offsets and not {"Hinge", "Sliding", "Opening", "OnSide", "Recessed"} & set(options):
        at = _offsets(reader, options)
        return At(FrameName(entryway.text, None, "", entryway.where), *at, inside=True)
    refused = {kind: options.pop(kind) for kind in offsets}
    _refuse(reader, refused, "is for objects placed at a frame", "write at <frame>, …")
    if "Hinge" in options and "Sliding" in options:
        where = reader.where(options["Sliding"])
        raise InputError(Diagnostic(where, "a door has a hinge or slides, not both"))
    if "Hinge" in options:
        return _hinged(reader, entryway, options)
    if "Sliding" in options:
        return _sliding(reader, entryway, options)
    yaw = _value(reader, options.pop("Turned", None), "angle")
    _refuse(reader, options, "needs hinge left, hinge right or sliding …", "say which side")
    return In(entryway, yaw=yaw)


def _hinged(reader: Reader, entryway: Name, options: dict[str, Any]) -> In:
    hinge = options.pop("Hinge")
    opening = options.pop("Opening", None)
    if opening is None:
        hint = "add opening inwards, opening outwards or opening into <space>"
        message = "to which side does the leaf open?"
        raise InputError(Diagnostic(reader.where(hinge), message, hint))
    recess = _value(reader, options.pop("Recessed", None), "length")
    _refuse(reader, options, "is not for doors with a hinge", "leave it out")
    return In(
        entryway,
        manner="hinge",
        side=hinge.side,
        seen_from=None if hinge.seen is None else reader.name(hinge.seen),
        towards=_towards(reader, opening),
        recess=recess,
    )


def _sliding(reader: Reader, entryway: Name, options: dict[str, Any]) -> In:
    sliding = options.pop("Sliding")
    side = options.pop("OnSide", None)
    _refuse(reader, options, "is not for sliding doors", "leave it out")
    return In(
        entryway,
        manner="sliding",
        side=sliding.side,
        seen_from=None if sliding.seen is None else reader.name(sliding.seen),
        towards="in" if side is None else _towards(reader, side),
    )


def _towards(reader: Reader, option: Any) -> Towards:
    if option.space is not None:
        return reader.name(option.space)
    return "in" if option.direction in ("inwards", "inside") else "out"


def _refuse(reader: Reader, options: dict[str, Any], because: str, hint: str) -> None:
    for kind, option in options.items():
        reader.report(reader.where(option), f'"{_WORDS[kind]}" {because}', hint)


def _value(reader: Reader, option: Any, dimension: str) -> float:
    return 0.0 if option is None else reader.value(option.value, dimension)
