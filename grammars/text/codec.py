"""Conversion between value types and JSON: canonical bytes, validated reading, digests.

JSON arrives from files and the network, so reading refuses missing fields and wrong types and
evaluates no code. Numbers are finite, as JSON requires; types that need infinity write it as text.
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
    # allow_inf_nan applies to one class only; nested dataclasses and unions do not inherit it. So
    # walk the whole schema once.
    return SchemaValidator(_guarded(_adapter(kind).core_schema, exactly))


_reader: Callable[[Any, bool], SchemaValidator] = functools.cache(_build_reader)


def _guarded(schema: Any, exactly: bool) -> Any:
    """Return the schema with finite floats only and, with ``exactly``, strict types.

    Classes that write infinity as text stay unchanged.
    """
    if isinstance(schema, dict):
        if (schema.get("config") or {}).get("ser_json_inf_nan") == "strings":
            return schema
        guarded = {k: v if k == "metadata" else _guarded(v, exactly) for k, v in schema.items()}
        finite = {"allow_inf_nan": False} if guarded.get("type") == "float" else {}
        strict = {"strict": True} if exactly and guarded.get("type") in _SCALARS else {}
        return guarded | finite | strict
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

    With ``exactly``, only output of :func:`to_json` is valid: no unknown fields, no numbers in
    quotes, no 1 for true. Raises :class:`pydantic.ValidationError` (a ``ValueError``).
    """
    extra: Literal["forbid", "ignore"] = "forbid" if exactly else "ignore"
    value: T = _reader(kind, exactly).validate_json(data, extra=extra)
    return value


def reading_error(error: ValueError) -> str:
    """Return the first problem that :func:`from_json` reports, as one line for people."""
    if not isinstance(error, ValidationError):
        return str(error)
    from grammars.text.documents import plain_message

    first, *others = error.errors(include_url=False)
    place = ".".join(map(str, first["loc"]))
    more = f" (and {len(others)} more)" if others else ""
    return f"{place} {plain_message(first)}".strip() + more


def from_plain(kind: type[T], data: Any) -> T:
    """Build a value type from dicts, lists, strings and numbers; raises ``ValidationError``.

    Unlike JSON, these may hold infinite numbers and NaN.
    """
    value: T = _adapter(kind).validate_python(data)
    return value


def digest(value: Any) -> str:
    """Return the SHA-256 of the canonical JSON of ``value`` as 64 hexadecimal digits."""
    return hashlib.sha256(to_json(value)).hexdigest()


def warm_up(*kinds: Any) -> None:
    """Build the validators of ``kinds`` now, so that forked processes share them."""
    for kind in kinds:
        _reader(kind, False)
