"""Safe forms of names from layers: as file names, and inside XML."""

from __future__ import annotations

import hashlib
import re
from collections.abc import Container
from typing import Final

from grammars.text.terminal_text import printable

_SAFE: Final = re.compile(r"[A-Za-z0-9_][A-Za-z0-9._@-]{0,99}")
_UNSAFE: Final = re.compile(r"[^A-Za-z0-9._-]+")
_NOT_XML: Final = re.compile("[^\t\n\r\u0020-\ud7ff\ue000-\ufffd\U00010000-\U0010ffff]")


def file_name(name: str) -> str:
    """Return ``name`` as one part of a path, without an ending.

    Letters, digits, ``.``, ``_``, ``-`` and ``@`` stay. Other characters and leading dots are
    replaced, and long names are cut. A changed name gets part of its digest, so that different
    names never become the same file.
    """
    if _SAFE.fullmatch(name):
        return name
    digest = hashlib.sha256(name.encode("utf-8", "surrogatepass")).hexdigest()[:8]
    stem = _UNSAFE.sub("-", name).strip(".-")[:80]
    return f"{stem}-{digest}" if stem else f"unnamed-{digest}"


def free_name(name: str, used: Container[str], separator: str = "-") -> str:
    """Return ``name``, or the first of ``name-2``, ``name-3``, … that is not in ``used``."""
    free, number = name, 2
    while free in used:
        free, number = f"{name}{separator}{number}", number + 1
    return free


def xml_text(text: str) -> str:
    """Return ``text`` without characters that XML 1.0 cannot contain (section 2.2).

    Characters that reverse text or control a terminal are replaced too.
    """
    return _NOT_XML.sub("\ufffd", printable(text))
