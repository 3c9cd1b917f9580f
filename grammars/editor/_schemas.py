"""JSON Schemas that editors complete and check YAML files with.

Pydantic's own schema describes the values of a model. The written form differs: quantities are
text with a unit, a list of one item may be that item, unset keys are left out. This module
describes the written form and takes each key's description from the string below its field.

The regular expressions of quantities accept the usual spellings that
:func:`grammars.text.quantity.read_as` reads. They refuse a missing unit and a unit of another
dimension. They use the common subset of ECMA-262 with the ``u`` flag and Python's ``re``.
"""

from __future__ import annotations

import ast
import dataclasses
import inspect
import math
import re
import textwrap
import typing
from collections.abc import Iterator
from typing import Any, Final

from pydantic import BaseModel, TypeAdapter

from grammars.text.diagnostics import with_article
from grammars.text.quantity import unit_of
from grammars.text.units import ANGLE, FORCE, LENGTH, RATIO, UNIT_WORDS, words_of

_NUMBER: Final = r"(?:\d+\.?\d*|\.\d+)(?:[eE][+-]?\d+)?"
_LENGTH: Final = words_of(LENGTH)
_ANGLE: Final = words_of(ANGLE)
_FORCE: Final = words_of(FORCE)
_ROOT: Final = r"\^0?\.5"
_PER: Final = r"\s*/\s*"
_TIMES: Final = r"(?:\s*\*\s*|\s+)"
_FACTOR: Final = r"[A-Za-z°]+(?:\^[0-9.]+|[²³])?"
_LONG_PRODUCT: Final = rf"{_FACTOR}(?:(?:{_PER}|{_TIMES}){_FACTOR}){{2,5}}"
"""Three factors or more in base units; only the reader can check their dimension."""

_SIGNS: Final = {"/": _PER, "^2": r"(?:\^2|²)", "^0.5": _ROOT}
"""Spellings of the signs between and behind the words of a unit."""

QUANTITY_EXAMPLES: Final = {
    "ratio": "5 %",
    "length": "0.35 m",
    "angle": "90 deg",
    "time": "30 s",
    "mass": "30 kg",
    "frequency": "10 Hz",
    "speed": "0.8 m/s",
    "angular speed": "60 deg/s",
    "acceleration": "1.0 m/s^2",
    "angular acceleration": "2.0 rad/s^2",
    "force": "80 N",
    "torque": "20 N m",
    "stiffness": "100 N/m",
    "noise per root length": "0.01 m/m^0.5",
    "noise per root angle": "0.02 rad/rad^0.5",
    "drift per root length": "0.005 rad/m^0.5",
}
"""One usual value of each dimension."""

_UNUSUAL: Final = {
    "ratio": f"{words_of(RATIO)}?",
    "torque": f"(?:{_FORCE}{_TIMES}{_LENGTH}|{_LENGTH}{_TIMES}{_FORCE})",
    "noise per root length": f"{_LENGTH}(?:{_PER}{_LENGTH})?{_ROOT}",
    "noise per root angle": f"{_ANGLE}(?:{_PER}{_ANGLE})?{_ROOT}",
}
"""Units whose parts are optional or may change places."""

_SIMPLE: Final = ("ratio", "length", "angle", "time", "mass", "frequency")


def quantity_pattern(dimension: str, *, signed: bool = True, nonzero: bool = False) -> str:
    """Return the expression that a quantity of ``dimension`` matches as a whole.

    ``signed`` allows a minus, ``nonzero`` requires a digit other than 0 before the unit.
    """
    parts = re.findall(r"[A-Za-z]+|\^[\d.]+|/", unit_of(dimension))
    unit = _UNUSUAL.get(dimension) or "".join(map(_spelling, parts))
    if dimension not in _SIMPLE:
        unit = f"(?:{unit}|{_LONG_PRODUCT})"
    sign = "[+-]?" if signed else r"\+?"
    digit = "(?=[^A-Za-z]*[1-9])" if nonzero else ""
    return rf"^\s*{digit}{sign}{_NUMBER}\s*{unit}\s*$"


def _spelling(part: str) -> str:
    """Return the expression for a sign of a unit, or for all synonyms of a word of it."""
    return _SIGNS.get(part) or words_of(UNIT_WORDS[part][1])


Schema = dict[str, Any]

DIALECT: Final = "https://json-schema.org/draft/2020-12/schema"
_BOUNDS: Final = {
    "gt": "exclusiveMinimum",
    "ge": "minimum",
    "lt": "exclusiveMaximum",
    "le": "maximum",
}
"""Pydantic's names of bounds beside ``anyOf``, where JSON Schema's words do not apply."""

_WORDS: Final = {
    "exclusiveMinimum": "above",
    "minimum": "at least",
    "exclusiveMaximum": "below",
    "maximum": "at most",
}


def editor_schema(model: type[Any], title: str) -> Schema:
    """Return the JSON Schema (draft 2020-12) of files read by ``model``.

    ``model`` is a pydantic model or pydantic dataclass; strings below its fields become
    descriptions. Definitions are named after their classes.
    """
    # Definitions take the names of classes: renaming a class ...Text changes published schemas.
    raw = TypeAdapter(model).json_schema(by_alias=True)
    classes = {kind.__name__: kind for kind in _reachable(model, set())}
    definitions = raw.pop("$defs", {})
    schema: Schema = {"$schema": DIALECT, "title": title}
    schema |= _with_descriptions(raw, model)
    if definitions:
        schema["$defs"] = {
            _short(name): _with_descriptions(body, classes[name])
            for name, body in sorted(definitions.items())
        }
    return schema


def _reachable(kind: Any, visited: set[Any]) -> Iterator[type[Any]]:
    """Yield the classes with fields that ``kind`` is made of."""
    if isinstance(kind, type) and (issubclass(kind, BaseModel) or dataclasses.is_dataclass(kind)):
        if kind in visited:
            return
        visited.add(kind)
        yield kind
        for hint in typing.get_type_hints(kind, include_extras=True).values():
            yield from _reachable(hint, visited)
    for argument in (*typing.get_args(kind), getattr(kind, "json_schema_input_type", None)):
        if argument is not None:
            yield from _reachable(argument, visited)


def _short(name: str) -> str:
    return name.removeprefix("_").removesuffix("Text").lower()


def _with_descriptions(raw: Schema, owner: type[Any]) -> Schema:
    """Return the schema of one class, described by its docstrings."""
    schema: Schema = _as_written(raw)
    schema.setdefault("description", " ".join((owner.__doc__ or "").split()))
    words = _field_docs(owner)
    aliases = {
        field.alias: name
        for name, field in getattr(owner, "model_fields", {}).items()
        if field.alias
    }
    for key, body in schema.get("properties", {}).items():
        text = words.get(aliases.get(key, key), "")
        parts = [part for part in (text, body.get("description", "")) if part]
        if parts:
            schema["properties"][key] = {"description": " ".join(parts)} | {
                k: v for k, v in body.items() if k != "description"
            }
    return schema


def _field_docs(owner: type[Any]) -> dict[str, str]:
    """Return the strings below the fields of a class, inherited fields included."""
    docs: dict[str, str] = {}
    for base in owner.__bases__:
        if base is not BaseModel and (
            issubclass(base, BaseModel) or dataclasses.is_dataclass(base)
        ):
            docs |= _field_docs(base)
    (body,) = ast.parse(textwrap.dedent(inspect.getsource(owner))).body
    assert isinstance(body, ast.ClassDef)
    for field, below in zip(body.body, body.body[1:], strict=False):
        if (
            isinstance(field, ast.AnnAssign)
            and isinstance(field.target, ast.Name)
            and isinstance(below, ast.Expr)
            and isinstance(below.value, ast.Constant)
        ):
            docs[field.target.id] = " ".join(str(below.value.value).split())
    return docs


def _as_written(node: Any) -> Any:
    """Rewrite a pydantic schema, from the leaves up, for the written form."""
    if isinstance(node, list):
        return [_as_written(item) for item in node]
    if not isinstance(node, dict):
        return node
    if "quantity" in node:
        return _quantity(node)
    schema = {key: _values(key, value) for key, value in node.items() if key != "title"}
    if "$ref" in schema:
        schema["$ref"] = f"#/$defs/{_short(schema['$ref'].rpartition('/')[2])}"
    if "prefixItems" in schema:
        # Both items are alike, and older drafts also read a plain "items".
        schema["items"] = schema.pop("prefixItems")[0]
    if "patternProperties" in schema:
        schema["additionalProperties"] = False
    if schema.get("default", 0) in (None, "", {}) or isinstance(schema.get("default"), dict):
        del schema["default"]
    return _without_null(schema)


def _values(key: str, value: Any) -> Any:
    """Rewrite the value of a key; under ``properties`` every key is a name, even ``title``."""
    if key in ("properties", "patternProperties", "$defs"):
        return {name: _as_written(body) for name, body in value.items()}
    return (
        value if key in ("default", "enum", "const", "required", "examples") else _as_written(value)
    )


def _without_null(schema: Schema) -> Schema:
    """Leave out the choice of ``null``: unset keys are not written."""
    choices = [c for c in schema.get("anyOf", ()) if c != {"type": "null"}]
    if len(choices) == len(schema.get("anyOf", ())):
        return schema
    rest = {key: value for key, value in schema.items() if key != "anyOf"}
    return choices[0] | rest if len(choices) == 1 else rest | {"anyOf": choices}


def _quantity(node: Schema) -> Schema:
    """Return the schema of a quantity: text with a unit, or also a number if the key allows it."""
    dimension, plain = node["quantity"]["dimension"], node["quantity"]["plain"]
    bounds = {_BOUNDS.get(k, k): v for k, v in node.items() if _BOUNDS.get(k, k) in _WORDS}
    low, above = bounds.get("minimum"), bounds.get("exclusiveMinimum")
    example = QUANTITY_EXAMPLES[dimension]
    limits = ", ".join(
        f"{_WORDS[k]} {_quantity_text(bounds[k], dimension)}" for k in _WORDS if k in bounds
    )
    expected = f'expected {with_article(dimension)} such as "{example}"'
    schema: Schema = {"description": _quantity_sentence(dimension, limits, plain)}
    schema["type"] = "string"
    if plain or dimension == "ratio":
        # Patterns apply to strings only and bounds to numbers only.
        schema |= {"type": ["number", "string"]} | bounds
    schema["pattern"] = quantity_pattern(
        dimension,
        signed=low is None and above is None,
        nonzero=above is not None or (low is not None and low > 0),
    )
    # The YAML language server reads these keywords; other tools ignore them.
    schema |= {"errorMessage": f"{expected}{limits and ', '}{limits}", "examples": [example]}
    # An infinite or out-of-bounds default stands for an unset key.
    default = node.get("default", math.inf)
    if default not in (None, above, math.inf) and not (low is not None and default < low):
        schema["default"] = default if plain else _quantity_text(default, dimension)
    return schema


def _quantity_sentence(dimension: str, limits: str, plain: bool) -> str:
    start = f"{dimension[0].upper()}{dimension[1:]}"
    unit, example = unit_of(dimension), QUANTITY_EXAMPLES[dimension]
    if dimension == "ratio":
        form = f"a number or percentage such as {example}"
    elif plain:
        form = f"a number in {unit}, or with a unit such as {example}"
    else:
        form = f"with its unit, such as {example}"
    return f"{start}, {form}{limits and '; '}{limits}."


def _quantity_text(value: float, dimension: str) -> str:
    unit = unit_of(dimension)
    return f"{value:g}" if unit == "1" else f"{value:g} {unit}"


def nullable(body: Schema) -> Schema:
    """Return a schema that also accepts ``null``, which removes an inherited value."""
    if "anyOf" in body:
        return body | {"anyOf": [*body["anyOf"], {"type": "null"}]}
    if "$ref" in body:
        rest = {key: value for key, value in body.items() if key != "$ref"}
        return rest | {"anyOf": [{"$ref": body["$ref"]}, {"type": "null"}]}
    changed = dict(body)
    if "type" in body:
        kinds = body["type"] if isinstance(body["type"], list) else [body["type"]]
        changed["type"] = [*kinds, "null"]
    # A constant that may be null is a choice of two values.
    if "const" in body:
        changed["enum"] = [changed.pop("const")]
    if "enum" in changed:
        changed["enum"] = [*changed["enum"], None]
    return changed
