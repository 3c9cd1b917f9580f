"""Tables of the keys of YAML files, made from the JSON Schemas that editors get.

A key's row says what may be written, what holds when nothing is, and what it means.
"""

import json
import re
from collections.abc import Mapping
from functools import cache
from typing import Any

from tests.docs.markdown import ROOT

SCHEMAS = ROOT / "grammars" / "editor" / "schemas"
Schema = Mapping[str, Any]
_HOW_WRITTEN = re.compile(
    r"(?:^|(?<=\. )|(?<=\.))[A-Z][a-z ]+, (?:a number|with its unit)"
    r"[^;]*?such as [^;]*?(?:; [^;]*?)?\.$"
)
"""The last sentence of a description of a quantity; the table has a column for that."""
_BOUNDLESS = re.compile(r",? at (?:least -|most )1e\+06 m\b")
"""Limits that no building reaches."""
_LIMITS = {"exclusiveMinimum": ">", "minimum": "≥", "exclusiveMaximum": "<", "maximum": "≤"}
_LIMIT_WORDS = {"above": ">", "at least": "≥", "below": "<", "at most": "≤"}
_IDLE = "Without effect here: "

_WORDS = {"string": "text", "integer": "integer", "number": "number"}
_WORDS |= {"boolean": "`true`, `false`"}


@cache
def schema(name):
    """Return a published schema: campaign, mission, oracles, robot, sut or walls."""
    return json.loads((SCHEMAS / f"{name}.schema.json").read_text("utf-8"))


def definition(name, part):
    """Return a part of a schema by its name, the schema itself by that of the file."""
    whole = schema(name)
    return whole if part == name and part not in whole.get("$defs", {}) else whole["$defs"][part]


def key_table(name, part, *only):
    """Return a Markdown table of the keys of a part of a schema, all or ``only`` some.

    ``only`` may begin with ``without``: keys that one of the following parts has as well are left
    out then. Equal rows are one row; keys without effect follow as a list.
    """
    body = definition(name, part)
    needed = set(body.get("required", ()))
    rows, idle = {}, {}
    for key, value in body["properties"].items():
        if not _is_wanted(name, key, value, only):
            continue
        cells = _cells(name, value, key in needed)
        if cells[-1].startswith(_IDLE):
            rows_of_kind, cells = idle, (cells[-1].removeprefix(_IDLE),)
        else:
            rows_of_kind = rows
        rows_of_kind.setdefault(cells, []).append(f"`{key}`")
    lines = ["| key | value | when left out | meaning |", "|---|---|---|---|"]
    for cells, keys in rows.items():
        lines.append(" | ".join((f"| {', '.join(keys)}", *cells, "")).rstrip())
    if idle:
        lines += ["", "Without effect here:", ""]
        lines += [f"- {', '.join(keys)}: {reason}" for (reason,), keys in idle.items()]
    return "\n".join((*lines, ""))


def _is_wanted(name, key, value, only):
    if only[:1] == ("without",):
        others = (definition(name, part)["properties"] for part in only[1:])
        return all(value != other.get(key) for other in others)
    return not only or key in only


def _cells(name, value, needed):
    """Return a key's value, its default and its meaning, as cells of the table."""
    default = value.get("default")
    if needed:
        left_out = "required"
    elif default is None or default == []:
        left_out = "–"
    else:
        left_out = f"`{_written(default)}`"
    meaning = _meaning(value) or _meaning(_referenced(name, value))
    cells = (_values(value), left_out, meaning)
    return tuple(cell.replace("|", "\\|") for cell in cells)


def _referenced(name, value):
    found = value.get("$ref", "")
    return definition(name, found.rpartition("/")[2]) if found else {}


def _written(value):
    if isinstance(value, bool):
        return str(value).lower()
    if isinstance(value, list):
        return f"[{', '.join(map(_written, value))}]"
    return f"{value:.6g}" if isinstance(value, float) else str(value)


def _values(value):
    """Return what may be written, in a few words."""
    if "enum" in value or "const" in value:
        choices = value.get("enum", [value.get("const")])
        shown = [f"`{_written(one)}`" for one in choices if one is not None]
        return ", ".join(shown)
    if "errorMessage" in value:
        said = re.sub(r"^expected an? ", "", value["errorMessage"])
        return _quantity(_BOUNDLESS.sub("", said))
    if "$ref" in value:
        return f"keys of {_part(value['$ref'])}"
    choices = value.get("anyOf", ())
    if choices:
        return _joined(list(dict.fromkeys(filter(None, map(_values, choices)))))
    if "patternProperties" in value:
        inner = next(iter(value["patternProperties"].values()))
        return f"by name: {_values(inner)}"
    return _plain(value)


def _joined(choices):
    """Return alternatives without those that another one includes."""
    if "number" in choices and "integer" in choices:
        choices.remove("integer")
    *single, last = choices
    return (
        f"{' or '.join(single)}, or a list"
        if last == f"list of {' or '.join(single)}"
        else " or ".join(choices)
    )


def _plain(value):
    kind = value.get("type", "")
    kinds = [kind] if isinstance(kind, str) else [one for one in kind if one != "null"]
    if "array" in kinds:
        return f"list of {_values(value.get('items', {})) or 'values'}"
    if "object" in kinds:
        inner = value.get("additionalProperties")
        if isinstance(inner, dict) and inner.get("type") == "object":
            return "`NAME: {…}`"
        said = _values(inner) if isinstance(inner, dict) else ""
        return f"by name: {said or 'values'}"
    return " or ".join(_WORDS[one] for one in kinds if one in _WORDS) + _bounds(value)


def _quantity(said):
    """Return the kind of a quantity and its limits, or an example if no limit shows a unit."""
    quantity, *limits = said.split(", ")
    kind, _, example = quantity.partition(" such as ")
    if not example:
        return said
    for words, sign in _LIMIT_WORDS.items():
        limits = [re.sub(f"^{words}", sign, limit) for limit in limits]
    if any(limit.count(" ") > 1 for limit in limits):  # a sign, a number, a unit
        return f"{kind} {', '.join(limits)}"
    return ", ".join((kind, "such as " + example.replace('"', "`"), *limits))


def _bounds(value):
    if {"minimum", "maximum"} <= value.keys():
        return f", {value['minimum']:g} to {value['maximum']:g}"
    limits = [f"{sign} {value[key]:g}" for key, sign in _LIMITS.items() if key in value]
    return f" {', '.join(limits)}" if limits else ""


def _part(reference):
    return f"`{reference.rpartition('/')[2]}`"


def _meaning(value):
    """Return the description in one line, without how the quantity is written."""
    said = value.get("description", "")
    if "errorMessage" in value:
        said = _HOW_WRITTEN.sub("", said)
    return " ".join(said.split())


def keys_of(name):
    """Return every key of a schema as PART.KEY."""
    parts = {name: schema(name), **schema(name).get("$defs", {})}
    return frozenset(
        f"{part}.{key}" for part, body in parts.items() for key in body.get("properties", ())
    )


def used_keys(name, data):
    """Return the keys of a schema that a document makes use of, as PART.KEY."""
    return frozenset(_used(name, name, schema(name), data))


def _used(name, part, body, data):
    if "$ref" in body:
        part = body["$ref"].rpartition("/")[2]
        body = definition(name, part)
    for choice in _choices(body):
        yield from _used(name, part, choice, data)
    if isinstance(data, dict):
        for key, value in data.items():
            if key in body.get("properties", {}):
                yield f"{part}.{key}"
                yield from _used(name, part, body["properties"][key], value)
            for pattern, inner in body.get("patternProperties", {}).items():
                if re.search(pattern, str(key)):
                    yield from _used(name, part, inner, value)
            more = body.get("additionalProperties")
            if isinstance(more, dict) and key not in body.get("properties", {}):
                yield from _used(name, part, more, value)
    elif isinstance(data, list) and isinstance(body.get("items"), dict):
        for value in data:
            yield from _used(name, part, body["items"], value)


def _choices(body):
    found = [*body.get("anyOf", ()), *body.get("oneOf", ())]
    found += [rule["then"] for rule in body.get("allOf", ()) if "then" in rule]
    return [choice for choice in found if choice.keys() - {"required"}]
