"""Names of layers in a campaign file: one, several, some with values for their parameters.

Any other value gets one finding in plain words.
"""

from __future__ import annotations

from typing import Annotated, Any, TypeAlias

from pydantic import BeforeValidator, Field, PlainValidator
from pydantic_core import PydanticCustomError

from grammars.text.documents import ONE_OR_MORE, as_list, wrong_form

Overrides: TypeAlias = dict[str, Any]
_OneLayer: TypeAlias = Annotated[
    dict[str, Overrides], Field(json_schema_extra={"minProperties": 1, "maxProperties": 1})
]


def _layer(value: Any) -> Any:
    """Check the name of a layer, alone or with overrides; raises ``ValueError`` in plain words."""
    if isinstance(value, str):
        return value
    if isinstance(value, list):
        raise ValueError("takes one layer here, not a list: write its name without brackets")
    if isinstance(value, bool | int | float):
        # YAML made a number or a flag of a name: the reader of the error says how to write it.
        raise PydanticCustomError("string_type", "must be text")
    if not isinstance(value, dict) or not value:
        raise ValueError("must be NAME or NAME: {parameter: value}, not nothing")
    for name, overrides in value.items():
        if overrides is None:
            raise ValueError(f'"{name}:" has no values behind it: without any, write {name}')
        if not isinstance(overrides, dict):
            text = " ".join(str(overrides).split())[:40]
            raise ValueError(f"write {name}: {{parameter: value}}, not {name}: {text}")
    return value


LayerName: TypeAlias = Annotated[
    str | dict[str, Overrides],
    # A union would report each of its members, in terms of Python.
    PlainValidator(_layer, json_schema_input_type=str | _OneLayer),
]


def _name_alone(value: Any) -> Any:
    """Return a name; raises for lists, keys and ``null``, the likely mistakes."""
    if isinstance(value, list):
        raise wrong_form("takes one name, not a list: write it without brackets")
    if isinstance(value, dict):
        raise wrong_form("takes a name, not keys: its definition is written elsewhere")
    if value is None:
        raise wrong_form("names nothing")
    return value


def _no_mapping(value: Any) -> Any:
    if isinstance(value, dict):
        raise wrong_form("takes names, not keys: their definitions are written elsewhere")
    return value


OneName: TypeAlias = Annotated[str, BeforeValidator(_name_alone, json_schema_input_type=str)]
Names: TypeAlias = Annotated[list[OneName], ONE_OR_MORE, BeforeValidator(_no_mapping)]
References: TypeAlias = Annotated[
    list[LayerName], BeforeValidator(as_list, json_schema_input_type=LayerName | list[LayerName])
]
