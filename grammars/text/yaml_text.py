"""Values as YAML that the readers of this project, and any other, read as the same values."""

from __future__ import annotations

import json
import re
from collections.abc import Mapping
from typing import Any, Final

_PLAIN: Final = re.compile(r"[A-Za-z_][A-Za-z0-9_]*\Z")


def yaml_text(tree: Mapping[str, Any], indent: str = "") -> str:
    """Return mappings as block YAML, everything else as JSON, which YAML 1.2 reads the same.

    JSON writes the shortest text that reads back as the same number: the run is the very same.
    """
    lines = []
    for key, value in tree.items():
        name = key if _PLAIN.match(key) else json.dumps(key, ensure_ascii=False)
        if isinstance(value, Mapping) and value:
            lines.append(f"{indent}{name}:\n{yaml_text(value, indent + '  ')}")
        elif isinstance(value, list) and value and isinstance(value[0], Mapping):
            items = (f"{indent}  - {json.dumps(item, ensure_ascii=False)}\n" for item in value)
            lines.append(f"{indent}{name}:\n{''.join(items)}")
        else:
            lines.append(f"{indent}{name}: {json.dumps(value, ensure_ascii=False)}\n")
    return "".join(lines)


def comment_text(text: str) -> str:
    """Return text as lines of a comment, empty when there is none."""
    return "".join(f"# {line}".rstrip() + "\n" for line in text.splitlines())
