"""From the models that read YAML files to the JSON Schemas editors complete and check with.

Pydantic's own schema describes what a model holds; people write something else: quantities are
text with a unit, lists of one may be the one, unset keys are left out. This module says so, and
takes each key's description from the string below its field.
"""

from __future__ import annotations

import ast
import dataclasses
import inspect
import textwrap
import typing
from collections.abc import Iterator
from typing import Any, Final

from pydantic import BaseModel, TypeAdapter

from grammars.editor._units import EXAMPLES, quantity_pattern
from grammars.quantity import unit_of

Schema = dict[str, Any]

DIALECT: Final = "https://json-schema.org/draft/2020-12/schema"
_BOUNDS: Final = {
    "gt": "exclusiveMinimum",
    "ge": "minimum",
    "lt": "exclusiveMaximum",
    "le": "maximum",
}
"""Bounds as pydantic names them where JSON Schema's words have no place, beside ``anyOf``."""

_WORDS: Final = {
    "exclusiveMinimum": "above",
    "minimum": "at least",
    "exclusiveMaximum": "below",
    "maximum": "at most",
}


def editor_schema(model: type[Any], title: str) -> Schema:
    """Return the JSON Schema (draft 2020-12) of files read by ``model``.

    ``model`` is a pydantic model or pydantic dataclass; strings below its fields become
    descriptions. Definitions are called after their classes.
    """
    raw = TypeAdapter(model).json_schema(by_alias=True)
    classes = {found.__name__: found for found in _reachable(model, set())}
    definitions = raw.pop("$defs", {})
    schema: Schema = {"$schema": DIALECT, "title": title}
    schema |= _described(raw, model)
    if definitions:
        schema["$defs"] = {
            _short(name): _described(body, classes[name])
            for name, body in sorted(definitions.items())
        }
    return schema


def _reachable(kind: Any, seen: set[Any]) -> Iterator[type[Any]]:
    """Yield the classes with fields that ``kind`` is made of."""
    if isinstance(kind, type) and (issubclass(kind, BaseModel) or dataclasses.is_dataclass(kind)):
        if kind in seen:
            return
        seen.add(kind)
        yield kind
        for hint in typing.get_type_hints(kind, include_extras=True).values():
            yield from _reachable(hint, seen)
    for argument in typing.get_args(kind):
        yield from _reachable(argument, seen)


def _short(name: str) -> str:
    return name.removeprefix("_").removesuffix("Text").lower()


def _described(raw: Schema, owner: type[Any]) -> Schema:
    """Return the schema of one class in the words of its docstrings."""
    schema: Schema = _polished(raw)
    schema.setdefault("description", " ".join((owner.__doc__ or "").split()))
    words = _field_docs(owner)
    aliases = {
        field.alias: name
        for name, field in getattr(owner, "model_fields", {}).items()
        if field.alias
    }
    for key, body in schema.get("properties", {}).items():
        said = words.get(aliases.get(key, key), "")
        parts = [part for part in (said, body.get("description", "")) if part]
        if parts:
            schema["properties"][key] = {"description": " ".join(parts)} | {
                k: v for k, v in body.items() if k != "description"
            }
    return schema


def _field_docs(owner: type[Any]) -> dict[str, str]:
    """Return the strings written below the fields of a class."""
    (body,) = ast.parse(textwrap.dedent(inspect.getsource(owner))).body
    assert isinstance(body, ast.ClassDef)
    docs: dict[str, str] = {}
    for field, below in zip(body.body, body.body[1:], strict=False):
        if (
            isinstance(field, ast.AnnAssign)
            and isinstance(field.target, ast.Name)
            and isinstance(below, ast.Expr)
            and isinstance(below.value, ast.Constant)
        ):
            docs[field.target.id] = " ".join(str(below.value.value).split())
    return docs


def _polished(node: Any) -> Any:
    """Rewrite a pydantic schema, from the leaves up, into what people write."""
    if isinstance(node, list):
        return [_polished(item) for item in node]
    if not isinstance(node, dict):
        return node
    if "quantity" in node:
        return _quantity(node)
    schema = {key: _values(key, value) for key, value in node.items() if key != "title"}
    if "$ref" in schema:
        schema["$ref"] = f"#/$defs/{_short(schema['$ref'].rpartition('/')[2])}"
    if "prefixItems" in schema:
        # Both items are alike, and older drafts read a plain "items" as well.
        schema["items"] = schema.pop("prefixItems")[0]
    if "patternProperties" in schema:
        schema["additionalProperties"] = False
    if schema.get("default", 0) in (None, "", {}) or isinstance(schema.get("default"), dict):
        del schema["default"]
    return _without_null(schema)


def _values(key: str, value: Any) -> Any:
    """Polish a value; under ``properties`` every key is a name, ``title`` as well."""
    if key in ("properties", "patternProperties", "$defs"):
        return {name: _polished(body) for name, body in value.items()}
    return (
        value if key in ("default", "enum", "const", "required", "examples") else _polished(value)
    )


def _without_null(schema: Schema) -> Schema:
    """Leave out the choice of ``null``: what is not set is not written."""
    choices = [c for c in schema.get("anyOf", ()) if c != {"type": "null"}]
    if len(choices) == len(schema.get("anyOf", ())):
        return schema
    rest = {key: value for key, value in schema.items() if key != "anyOf"}
    return choices[0] | rest if len(choices) == 1 else rest | {"anyOf": choices}


def _quantity(node: Schema) -> Schema:
    """Return the schema of a quantity: text with a unit, a plain number where that is read."""
    dimension, plain = node["quantity"]["dimension"], node["quantity"]["plain"]
    bounds = {_BOUNDS.get(k, k): v for k, v in node.items() if _BOUNDS.get(k, k) in _WORDS}
    low, above = bounds.get("minimum"), bounds.get("exclusiveMinimum")
    example = EXAMPLES[dimension]
    limits = ", ".join(
        f"{_WORDS[k]} {_written(bounds[k], dimension)}" for k in _WORDS if k in bounds
    )
    article = "an" if dimension[0] in "aeiou" else "a"
    expected = f'expected {article} {dimension} such as "{example}"'
    schema: Schema = {"description": _sentence(dimension, limits, plain)}
    schema["type"] = "string"
    if plain or dimension == "ratio":
        # Patterns speak of strings alone and bounds of numbers alone.
        schema |= {"type": ["number", "string"]} | bounds
    schema["pattern"] = quantity_pattern(
        dimension,
        signed=low is None and above is None,
        nonzero=above is not None or (low is not None and low > 0),
    )
    # Read by the YAML language server; unknown keywords mean nothing to others.
    schema |= {"errorMessage": f"{expected}{limits and ', '}{limits}", "examples": [example]}
    default = node.get("default")
    if default is not None:
        schema["default"] = default if plain else _written(default, dimension)
    return schema


def _sentence(dimension: str, limits: str, plain: bool) -> str:
    start = f"{dimension[0].upper()}{dimension[1:]}"
    unit, example = unit_of(dimension), EXAMPLES[dimension]
    if dimension == "ratio":
        form = f"a number or percentage such as {example}"
    elif plain:
        form = f"a number in {unit}, or with a unit such as {example}"
    else:
        form = f"with its unit, such as {example}"
    return f"{start}, {form}{limits and '; '}{limits}."


def _written(value: float, dimension: str) -> str:
    unit = unit_of(dimension)
    return f"{value:g}" if unit == "1" else f"{value:g} {unit}"
