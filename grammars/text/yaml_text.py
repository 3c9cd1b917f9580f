"""Writer of YAML that every reader reads back as the same values."""

from __future__ import annotations

import json
import re
from collections.abc import Mapping
from typing import Any, Final

from grammars.text.yaml_composer import read_plain

_PLAIN_KEY: Final = re.compile(r"[A-Za-z_][A-Za-z0-9_.]*\Z")
_PLAIN_WORDS: Final = re.compile(
    r"(?:-?[0-9]|[A-Za-z_]|\.\./)[A-Za-z0-9_./^%+-]*(?: [A-Za-z0-9_./^%*+<>=-]+)*\Z"
)
_FLAGS: Final = frozenset({"yes", "no", "on", "off"})
"""Words that are text in YAML 1.2 and flags for older readers."""


def yaml_text(tree: Mapping[str, Any], indent: str = "", *, plain: bool = False) -> str:
    """Return mappings as block YAML and all other values as JSON, which is valid YAML 1.2.

    Numbers read back exactly. With ``plain``, text and keys have quotes only where required.
    """
    lines = []
    for key, value in tree.items():
        name = _key(key, plain)
        if isinstance(value, Mapping) and value:
            lines.append(f"{indent}{name}:\n{yaml_text(value, indent + '  ', plain=plain)}")
        elif isinstance(value, list) and value and isinstance(value[0], Mapping):
            items = (f"{indent}  - {flow_text(item, plain)}\n" for item in value)
            lines.append(f"{indent}{name}:\n{''.join(items)}")
        else:
            lines.append(f"{indent}{name}: {flow_text(value, plain)}\n")
    return "".join(lines)


def comment_text(text: str) -> str:
    """Return text as comment lines."""
    return "".join(f"# {line}".rstrip() + "\n" for line in text.splitlines())


def _key(key: str, plain: bool) -> str:
    return key if _PLAIN_KEY.match(key) and not _quoted(key) else flow_text(key, plain)


def flow_text(value: Any, plain: bool) -> str:
    """Return a value as YAML on one line."""
    if isinstance(value, Mapping):
        name = _key if plain else flow_text
        pairs = (f"{name(key, plain)}: {flow_text(part, plain)}" for key, part in value.items())
        return "{" + ", ".join(pairs) + "}"
    if isinstance(value, list | tuple):
        return f"[{', '.join(flow_text(part, plain) for part in value)}]"
    if plain and isinstance(value, str) and not _quoted(value):
        return value
    if isinstance(value, float):
        # YAML 1.1 reads 1e-07 as text.
        return re.sub(r"^(-?[0-9]+)e", r"\1.0e", json.dumps(value))
    return json.dumps(value, ensure_ascii=False)


def _quoted(text: str) -> bool:
    """Return whether a text has another meaning without quotes."""
    if not _PLAIN_WORDS.match(text) or text.lower() in _FLAGS:
        return True
    return read_plain(text) != text
