"""Reading instances: which object stands where, at a frame or in an entryway."""

from __future__ import annotations

from typing import Any, Final

from grammars.scenery._reader import NodeReader, WordNode
from grammars.scenery.model import At, FrameName, In, Instance, Name, Subject, Towards
from grammars.text.diagnostics import InputError, SyntaxNode, TypedNode

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


class IsANode(TypedNode):
    """``door_1 is a hinged_door at hall.walls[1], x 1.2 m``."""

    model: WordNode
    place: AtNode | InNode
    options: list[SyntaxNode]

    def read(self, reader: NodeReader, subject: Subject) -> Instance:
        """Return the instance."""
        named = subject.names[0]
        if subject.every or len(subject.names) != 1 or subject.exceptions or named.joint:
            hint = "door_1 is a hinged_door at …"
            raise InputError.at(subject.where, "one object is placed at a time", hint)
        options = reader.options_by_rule(self.options)
        starts = options.pop("StartsIn", None)
        frozen = options.pop("FrozenOption", None) is not None
        return Instance(
            named.object,
            reader.name(self.model),
            self.place.read(reader, options),
            None if starts is None else reader.amount(starts.position, "angle", "length"),
            frozen,
            subject.where,
        )


class AtNode(TypedNode):
    """``at hall.walls[1]``."""

    frame: SyntaxNode

    def read(self, reader: NodeReader, options: dict[str, Any]) -> At:
        """Return the place; ``options`` are those of the instance."""
        at = _offsets(reader, options)
        _refuse(reader, options, "is for objects placed in an entryway", "write in <entryway>, …")
        return At(reader.frame(self.frame), *at)


class InNode(TypedNode):
    """``in kitchen_doorway``, or in a space."""

    entryway: WordNode

    def read(self, reader: NodeReader, options: dict[str, Any]) -> At | In:
        """Return the place; ``options`` are those of the instance."""
        return _in(reader, reader.name(self.entryway), options)


INSTANCE_RULES: Final = (IsANode, AtNode, InNode)
"""Classes of syntax nodes, named like their rules."""


def _offsets(reader: NodeReader, options: dict[str, Any]) -> tuple[float, float, float]:
    return (
        _value(reader, options.pop("XIs", None), "length"),
        _value(reader, options.pop("YIs", None), "length"),
        _value(reader, options.pop("Turned", None), "angle"),
    )


def _in(reader: NodeReader, entryway: Name, options: dict[str, Any]) -> At | In:
    # x and y mean a place in a space: "in kitchen, x 1 m". Whether kitchen is a space only the
    # floor plan knows, so this is checked when the layer meets it.
    offsets = [kind for kind in options if kind in ("XIs", "YIs")]
    if offsets and not {"Hinge", "Sliding", "Opening", "OnSide", "Recessed"} & set(options):
        at = _offsets(reader, options)
        return At(FrameName(entryway.text, None, "", entryway.where), *at, inside=True)
    refused = {kind: options.pop(kind) for kind in offsets}
    _refuse(reader, refused, "is for objects placed at a frame", "write at <frame>, …")
    if "Hinge" in options and "Sliding" in options:
        where = reader.where(options["Sliding"])
        raise InputError.at(where, "a door has a hinge or slides, not both")
    if "Hinge" in options:
        return _hinged(reader, entryway, options)
    if "Sliding" in options:
        return _sliding(reader, entryway, options)
    yaw = _value(reader, options.pop("Turned", None), "angle")
    _refuse(reader, options, "needs hinge left, hinge right or sliding …", "say which side")
    return In(entryway, yaw=yaw)


def _hinged(reader: NodeReader, entryway: Name, options: dict[str, Any]) -> In:
    hinge = options.pop("Hinge")
    opening = options.pop("Opening", None)
    if opening is None:
        hint = "add opening inwards, opening outwards or opening into <space>"
        message = "to which side does the leaf open?"
        raise InputError.at(reader.where(hinge), message, hint)
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


def _sliding(reader: NodeReader, entryway: Name, options: dict[str, Any]) -> In:
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


def _towards(reader: NodeReader, option: Any) -> Towards:
    if option.space is not None:
        return reader.name(option.space)
    return "in" if option.direction in ("inwards", "inside") else "out"


def _refuse(reader: NodeReader, options: dict[str, Any], because: str, hint: str) -> None:
    for kind, option in options.items():
        reader.report(reader.where(option), f'"{_WORDS[kind]}" {because}', hint)


def _value(reader: NodeReader, option: Any, dimension: str) -> float:
    return 0.0 if option is None else reader.value(option.value, dimension)
