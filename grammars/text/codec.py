"""One way between value types and JSON: canonical bytes, validated reading, digests.

Reading validates (missing fields and wrong types are refused) because JSON arrives from files
and from the network; nothing is ever evaluated or unpickled. Numbers are finite: JSON has no
others, and who has to write some writes them as text.
"""

from __future__ import annotations

import functools
import hashlib
from collections.abc import Callable
from typing import Any, Final, Literal, TypeVar

from pydantic import TypeAdapter
from pydantic_core import SchemaValidator, ValidationError

T = TypeVar("T")
_SCALARS: Final = frozenset({"bool", "int", "float", "str"})


_adapter: Callable[[Any], TypeAdapter[Any]] = functools.cache(TypeAdapter)


def _build_reader(kind: Any, exactly: bool) -> SchemaValidator:
    # allow_inf_nan is a setting of one class: dataclasses inside of it, and unions of them, do not
    # take it over. So the whole schema is walked, once.
    return SchemaValidator(_guarded(_adapter(kind).core_schema, exactly))


_reader: Callable[[Any, bool], SchemaValidator] = functools.cache(_build_reader)


def _guarded(schema: Any, exactly: bool) -> Any:
    """Return the schema with every float bound to be finite, and exact types if so wanted.

    What writes the infinite as text is left as it is.
    """
    if isinstance(schema, dict):
        if (schema.get("config") or {}).get("ser_json_inf_nan") == "strings":
            return schema
        made = {k: v if k == "metadata" else _guarded(v, exactly) for k, v in schema.items()}
        finite = {"allow_inf_nan": False} if made.get("type") == "float" else {}
        strict = {"strict": True} if exactly and made.get("type") in _SCALARS else {}
        return made | finite | strict
    if type(schema) in (list, tuple):
        return type(schema)(_guarded(part, exactly) for part in schema)
    return schema


def to_json(value: Any, kind: Any = None) -> bytes:
    """Serialise a value type; equal values give equal bytes (fields in declaration order).

    ``kind`` names the type when it is not the class of ``value`` (``tuple[Waypoint, ...]``).
    """
    return _adapter(kind or type(value)).dump_json(value)


def to_plain(value: Any, kind: Any = None) -> Any:
    """Return ``value`` as dicts, lists, strings and numbers, ready for any JSON writer."""
    return _adapter(kind or type(value)).dump_python(value, mode="json")


def from_json(kind: type[T], data: bytes | str, *, exactly: bool = False) -> T:
    """Read a value type back from JSON.

    ``exactly`` takes only what :func:`to_json` may have written: no unknown fields, no number in
    quotes, no 1 for true.

    Raises :class:`pydantic.ValidationError` (a ``ValueError``) when the text is not such a value.
    """
    extra: Literal["forbid", "ignore"] = "forbid" if exactly else "ignore"
    value: T = _reader(kind, exactly).validate_json(data, extra=extra)
    return value


def reading_error(error: ValueError) -> str:
    """Return in a line for people what :func:`from_json` has against a text: the first of it."""
    if not isinstance(error, ValidationError):
        return str(error)
    from grammars.text.documents import plain_message

    found = error.errors(include_url=False)
    place = ".".join(map(str, found[0]["loc"]))
    more = f" (and {len(found) - 1} more)" if len(found) > 1 else ""
    return f"{place} {plain_message(found[0])}".strip() + more


def from_plain(kind: type[T], data: Any) -> T:
    """Build a value type from dicts, lists, strings and numbers; raises ``ValidationError``.

    Unlike JSON these may hold numbers that are not finite.
    """
    value: T = _adapter(kind).validate_python(data)
    return value


def digest(value: Any) -> str:
    """Return the SHA-256 of the canonical JSON of ``value`` as 64 hexadecimal digits."""
    return hashlib.sha256(to_json(value)).hexdigest()


def warm_up(*kinds: Any) -> None:
    """Build the validators of ``kinds`` now, for processes that fork before they use them."""
    for kind in kinds:
        _reader(kind, False)
