"""Types of messages, services and actions without ROS: definitions, RIHS01 hashes, CDR.

A type hash is SHA-256 over the description of a type and of all it is made of (REP 2016). A
service is a type of three fields (request, response, event), an action is the services and
messages it is carried by (https://design.ros2.org/articles/actions.html).
"""

from __future__ import annotations

import hashlib
import json
import re
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any, Final

import numpy as np

from daemon.stacks.ros2.rmw_zenoh.definitions import DISTRIBUTIONS, SHIPPED

NO_HASH: Final = "TypeHashNotSupported"
"""What stands in place of a hash in Humble, which has none."""

_LARGEST_FILE: Final = 1 << 20

_TYPE_NUMBERS: Final = {
    "int8": 2,
    "uint8": 3,
    "int16": 4,
    "uint16": 5,
    "int32": 6,
    "uint32": 7,
    "int64": 8,
    "uint64": 9,
    "float32": 10,
    "float64": 11,
    # A char of a .msg file is a uint8: rosidl translates it so before it describes types.
    "char": 3,
    "bool": 15,
    "byte": 16,
    "string": 17,
}
"""Numbers of ``type_description_interfaces/msg/FieldType``."""

_BOUNDED_STRING: Final = 21
_NESTED: Final = 1
_ARRAY, _BOUNDED_SEQUENCE, _SEQUENCE = 48, 96, 144

_FIELD: Final = re.compile(
    r"(?P<kind>[A-Za-z][A-Za-z0-9_]*(?:/[A-Za-z][A-Za-z0-9_]*){0,2})"
    r"(?P<bound><=\d+)?(?P<array>\[(?:<=)?\d*\])?"
    r"\s+(?P<name>[A-Za-z][A-Za-z0-9_]*)\s*(?P<rest>.*)"
)
_NAME: Final = re.compile(r"[a-z][a-z0-9_]*/(?:msg|srv|action)/[A-Za-z][A-Za-z0-9_]*")


class InterfaceError(Exception):
    """A definition is missing, or is none; the message says which, for people."""


class Interfaces:
    """The types of one distribution, or of a stack whose definition files are at hand.

    ``folders`` are looked into first: trees with ``<package>/msg/<Name>.msg`` (``srv``,
    ``action``) in them, in their ``share`` folder or one level below: sources or an installed
    workspace. Raises :class:`InterfaceError` for a distribution nobody knows and for folders that
    are none.
    """

    def __init__(self, distribution: str, folders: Sequence[Path] = ()) -> None:
        from rosbags.typesys import Stores, get_typestore

        if distribution not in DISTRIBUTIONS:
            raise InterfaceError(
                f"{distribution!r} is no distribution that rmw_zenoh can be spoken with: write one "
                f"of {', '.join(DISTRIBUTIONS)}"
            )
        for folder in folders:
            if not folder.is_dir():
                raise InterfaceError(f"there is no folder of interface definitions at {folder}")
        self.distribution = distribution
        self._folders = tuple(folders)
        self._common = get_typestore(Stores(f"ros2_{distribution}")).fielddefs
        self._store = get_typestore(Stores.EMPTY)
        self._hashes: dict[str, str] = {}

    @property
    def hashed(self) -> bool:
        """Whether this distribution has type hashes."""
        return self.distribution != "humble"

    def load(self, kind: str) -> None:
        """Make the types of a message, service or action ready; raises :class:`InterfaceError`.

        A service then has ``<kind>_Request`` and ``<kind>_Response``; an action ``_Goal``,
        ``_Result``, ``_Feedback``, ``_FeedbackMessage``, ``_SendGoal`` and ``_GetResult``.
        """
        if not _NAME.fullmatch(kind):
            raise InterfaceError(f"{kind!r} is no name of a type: write package/msg/Name")
        room = kind.split("/")[1]
        if room == "msg":
            self._register({}, [kind])
            return
        text = self._text(kind)
        if text is None:
            raise self._missing(kind)
        sections = _sections(text, kind, 2 if room == "srv" else 3)
        parts = (_service if room == "srv" else _action)(kind, *sections, events=self.hashed)
        self._register(parts, list(parts))

    def hash(self, kind: str) -> str:
        """Return ``RIHS01_...`` of a type that was loaded, or :data:`NO_HASH` in Humble."""
        if not self.hashed:
            return NO_HASH
        if kind not in self._hashes:
            self._hashes[kind] = type_hash(kind, self._store.fielddefs)
        return self._hashes[kind]

    def deserialize(self, data: bytes, kind: str) -> Any:
        """Read a message from CDR; raises ``ValueError`` for what is none of this type."""
        # rosbags' SerdeError is a ValueError only in name of what it wraps.
        from rosbags.serde import SerdeError

        try:
            return self._store.deserialize_cdr(data, kind)
        except (SerdeError, IndexError, ValueError) as error:
            raise ValueError(f"{kind}: {error}") from error

    def serialize(self, kind: str, **fields: Any) -> bytes:
        """Return little-endian CDR of a message; fields that are not given are empty or zero.

        Fields that this type does not have are left out, for they differ by distribution.
        """
        return bytes(self._store.serialize_cdr(self.make(kind, **fields), kind, little_endian=True))

    def make(self, kind: str, **fields: Any) -> Any:
        """Build a message of a loaded type, as :meth:`serialize` does."""
        values = {
            name: fields[name] if name in fields else self._blank(description)
            for name, description in self._store.fielddefs[kind][1]
        }
        return self._store.types[kind](**values)

    def field_types(self, kind: str) -> Mapping[str, str]:
        """Return name and type of those fields of a loaded type that are messages."""
        return {
            name: nested
            for name, description in self._store.fielddefs[kind][1]
            for nested in _nested(description)
        }

    def _blank(self, description: Any) -> Any:
        node, content = description
        if node == _NODE_NAME:
            return self.make(content)
        if node == _NODE_BASE:
            return _blank_value(content[0])
        (inner, what), count = content
        if node == _NODE_SEQUENCE:
            count = 0
        if inner == _NODE_NAME:
            return [self.make(what) for _ in range(count)]
        if what[0] == "string":
            return [""] * count
        kind = {"byte": "uint8", "char": "uint8"}.get(what[0], what[0])
        return np.zeros(count, dtype=np.dtype(kind))

    def _register(self, texts: Mapping[str, str], kinds: list[str]) -> None:
        new: dict[str, Any] = {}
        while kinds:
            kind = kinds.pop()
            if kind in new or kind in self._store.fielddefs:
                continue
            text = texts.get(kind)
            if text is None:
                text = self._text(kind)
            if text is not None:
                new[kind] = _parse(text, kind)
            elif kind in self._common:
                new[kind] = ([], self._common[kind][1])
            else:
                raise self._missing(kind)
            kinds += [nested for _, field in new[kind][1] for nested in _nested(field)]
        if new:
            self._store.register(new)

    def _text(self, kind: str) -> str | None:
        package, room, name = kind.split("/")
        file = f"{room}/{name}.{room}"
        for folder in self._folders:
            places = [folder / package, folder / "share" / package]
            places += [folder] if folder.name == package else []
            for place in (
                *places,
                *folder.glob(f"*/{package}"),
                *folder.glob(f"*/share/{package}"),
            ):
                if (place / file).is_file():
                    return _read(place / file)
        return SHIPPED[self.distribution].get(kind)

    def _missing(self, kind: str) -> InterfaceError:
        where = " and ".join(map(str, self._folders))
        looked = f" and not found in {where}" if where else ""
        return InterfaceError(
            f"the definition of {kind} is not among those shipped for {self.distribution}{looked}: "
            "name a folder that has it (definitions: FOLDER)"
        )


def distributions_with(kind: str, wanted: str) -> Iterator[str]:
    """Yield the distributions whose shipped definitions give a type or part of it this hash."""
    whole = re.sub(r"_(SendGoal|GetResult|FeedbackMessage)$", "", kind)
    for distribution in DISTRIBUTIONS:
        interfaces = Interfaces(distribution)
        try:
            interfaces.load(whole)
        except InterfaceError:
            continue
        if wanted == (interfaces.hash(kind) if interfaces.hashed else NO_HASH):
            yield distribution


def type_hash(kind: str, definitions: Mapping[str, Any]) -> str:
    """Return the RIHS01 hash of a type: ``definitions`` are fields by type, as rosbags has them.

    rosbags' own is wrong for ``char``, which is part of every service since Iron.
    """
    described: dict[str, Any] = {}

    def describe(name: str) -> None:
        described[name] = {}
        fields = [(key, field) for key, field in definitions[name][1]]
        for _, field in fields:
            for nested in _nested(field):
                if nested not in described:
                    describe(nested)
        # A structure without fields has this one: C has no empty structures.
        empty = [("structure_needs_at_least_one_member", (_NODE_BASE, ("uint8", 0)))]
        described[name] = {
            "type_name": name,
            "fields": [{"name": key, "type": _field_type(field)} for key, field in fields or empty],
        }

    describe(kind)
    text = json.dumps(
        {
            "type_description": described.pop(kind),
            "referenced_type_descriptions": [described[name] for name in sorted(described)],
        }
    )
    return f"RIHS01_{hashlib.sha256(text.encode()).hexdigest()}"


# rosbags describes a field as (node, content): see rosbags.interfaces.Nodetype.
_NODE_BASE, _NODE_NAME, _NODE_ARRAY, _NODE_SEQUENCE = 1, 2, 3, 4


def _field_type(description: Any) -> dict[str, Any]:
    node, content = description
    offset = capacity = 0
    if node == _NODE_ARRAY:
        (node, content), capacity = content
        offset = _ARRAY
    elif node == _NODE_SEQUENCE:
        (node, content), capacity = content
        offset = _BOUNDED_SEQUENCE if capacity else _SEQUENCE
    if node == _NODE_NAME:
        number, bound, nested = _NESTED, 0, content
    else:
        base, bound = content
        number, nested = _TYPE_NUMBERS[base], ""
        if bound:
            number = _BOUNDED_STRING
    return {
        "type_id": offset + number,
        "capacity": capacity,
        "string_capacity": bound,
        "nested_type_name": nested,
    }


def _nested(description: Any) -> Iterator[str]:
    node, content = description
    if node in (_NODE_ARRAY, _NODE_SEQUENCE):
        node, content = content[0]
    if node == _NODE_NAME:
        yield content


def _blank_value(base: str) -> Any:
    if base == "string":
        return ""
    if base == "bool":
        return False
    return 0.0 if base.startswith("float") else 0


def _parse(text: str, kind: str) -> Any:
    """Return a definition as rosbags has them, with no constants: they are no part of a type.

    Only names that were looked at go on from here: rosbags makes code of them.
    """
    return [], [field for field in (_field(line, kind) for line in text.splitlines()) if field]


def _field(line: str, kind: str) -> Any:
    line = line.split("#", 1)[0].strip()
    if not line:
        return None
    match = _FIELD.fullmatch(line)
    if match is None:
        raise InterfaceError(f"{kind}: {line!r} is no field of a definition")
    if match["rest"].startswith("="):
        return None
    base, bound, array = match["kind"], int((match["bound"] or "<=0")[2:]), match["array"]
    if base in ("wstring", "float128"):
        raise InterfaceError(f"{kind}: fields of type {base} are not understood")
    node: Any = (_NODE_BASE, (base, bound))
    if base not in _TYPE_NUMBERS:
        package, *_, name = base.split("/") if "/" in base else (kind.split("/")[0], base)
        if base == "Header":
            package = "std_msgs"
        node = (_NODE_NAME, base if base.count("/") == 2 else f"{package}/msg/{name}")
    if array is not None:
        count = int(array.strip("[<=]") or 0)
        node = (_NODE_ARRAY if re.fullmatch(r"\[\d+]", array) else _NODE_SEQUENCE, (node, count))
    return match["name"], node


def _sections(text: str, kind: str, count: int) -> list[str]:
    sections = re.split(r"^\s*---\s*$", text, flags=re.MULTILINE)
    if len(sections) != count:
        raise InterfaceError(
            f"{kind}: a definition of {count} sections has {count - 1} lines of ---, here are "
            f"{len(sections) - 1}"
        )
    return sections


def _service(kind: str, request: str, response: str, *, events: bool) -> dict[str, str]:
    parts = {f"{kind}_Request": request, f"{kind}_Response": response}
    if events:
        parts[f"{kind}_Event"] = (
            "service_msgs/ServiceEventInfo info\n"
            f"{kind}_Request[<=1] request\n{kind}_Response[<=1] response\n"
        )
        parts[kind] = (
            f"{kind}_Request request_message\n{kind}_Response response_message\n"
            f"{kind}_Event event_message\n"
        )
    return parts


def _action(kind: str, goal: str, result: str, feedback: str, *, events: bool) -> dict[str, str]:
    identifier = "unique_identifier_msgs/UUID goal_id\n"
    return {
        f"{kind}_Goal": goal,
        f"{kind}_Result": result,
        f"{kind}_Feedback": feedback,
        f"{kind}_FeedbackMessage": f"{identifier}{kind}_Feedback feedback\n",
        **_service(
            f"{kind}_SendGoal",
            f"{identifier}{kind}_Goal goal\n",
            "bool accepted\nbuiltin_interfaces/Time stamp\n",
            events=events,
        ),
        **_service(
            f"{kind}_GetResult",
            identifier,
            f"int8 status\n{kind}_Result result\n",
            events=events,
        ),
    }


def _read(path: Path) -> str:
    try:
        if path.stat().st_size > _LARGEST_FILE:
            raise InterfaceError(f"{path} is too large for a definition")
        return path.read_text(encoding="utf-8")
    except (OSError, UnicodeDecodeError) as error:
        raise InterfaceError(f"{path} cannot be read: {error}") from error
