"""Names of ROS, and roslaunch's conversion of texts to values.

Sources: rosgraph.names, roslaunch.loader.convert_value, roscpp's init of private parameters
(ROS Noetic).
"""

from __future__ import annotations

import re
from typing import Final, TypeAlias

ParameterName: TypeAlias = tuple[str, ...]
"""Parts of an absolute name of the parameter server."""
_LEGAL: Final = re.compile(r"^[~/]?[A-Za-z][A-Za-z0-9_/]*$")
_TRUE: Final = ("true", "1")
_FALSE: Final = ("false", "0")


def join_names(namespace: str, name: str) -> str:
    """Return ``name`` below ``namespace``, or unchanged if it is global or private."""
    if name.startswith(("/", "~")) or not namespace:
        return name
    return f"{namespace.rstrip('/')}/{name}"


def split_name(name: str) -> ParameterName:
    """Return the parts of a name; extra slashes are ignored."""
    return tuple(part for part in name.split("/") if part)


def absolute_name(parts: ParameterName) -> str:
    """Return the text of an absolute name."""
    return "/" + "/".join(parts)


def resolve_for_node(name: str, node: str) -> str:
    """Return the absolute name of ``name`` for the node with the absolute name ``node``."""
    if name.startswith("~"):
        return absolute_name(split_name(f"{node}/{name[1:]}"))
    return absolute_name(split_name(join_names(absolute_name(split_name(node)[:-1]), name)))


def is_legal(name: str) -> bool:
    """Return whether a text is a valid name of ROS."""
    return _LEGAL.match(name) is not None


def to_bool(text: str) -> bool:
    """Return the truth value in a text; raises ``ValueError``."""
    lowered = text.strip().lower()
    if lowered in _TRUE or lowered in _FALSE:
        return lowered in _TRUE
    raise ValueError(f'"{text}" is neither true nor false')


def convert_value(text: str, kind: str = "auto") -> bool | int | float | str:
    """Return the value of a ``<param>`` or of an ``<arg>`` in an expression.

    ``kind`` is the value of ``type``, except for ``yaml``. Raises ``ValueError``.
    """
    if kind == "auto":
        return _guess(text)
    if kind in ("str", "string"):
        return text
    if kind in ("bool", "boolean"):
        return to_bool(text)
    if kind not in ("int", "double"):
        raise ValueError(f'there is no type "{kind}"')
    try:
        return int(text) if kind == "int" else float(text)
    except ValueError as error:
        noun = "a whole number" if kind == "int" else "a number"
        raise ValueError(f'"{text}" is not {noun}') from error


def _guess(text: str) -> bool | int | float | str:
    """Return a number, a truth value or the text; real numbers need a decimal point."""
    try:
        return float(text) if "." in text else int(text)
    except ValueError:
        lowered = text.lower()
        return lowered == "true" if lowered in ("true", "false") else text


def convert_argument(text: str) -> bool | int | float | str:
    """Return the value of ``_name:=text`` among the arguments of a node."""
    for kind in (int, float):
        try:
            return kind(text)
        except ValueError:
            continue
    if text in ("true", "True", "TRUE"):
        return True
    return False if text in ("false", "False", "FALSE") else text
