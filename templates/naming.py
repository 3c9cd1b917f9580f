"""Names from layers made safe: as names of files, and inside XML."""

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

    Letters, digits, ``.``, ``_``, ``-`` and ``@`` stay; anything else (slashes, blanks, leading
    dots, more than 100 characters) is replaced, and part of a digest of the name is added, so
    that different names never become the same file.
    """
    if _SAFE.fullmatch(name):
        return name
    digest = hashlib.sha256(name.encode("utf-8", "surrogatepass")).hexdigest()[:8]
    kept = _UNSAFE.sub("-", name).strip(".-")[:80]
    return f"{kept}-{digest}" if kept else f"unnamed-{digest}"


def free_name(name: str, taken: Container[str], separator: str = "-") -> str:
    """Return ``name``, or the first of ``name-2``, ``name-3``, … that is not taken."""
    free, number = name, 2
    while free in taken:
        free, number = f"{name}{separator}{number}", number + 1
    return free


def xml_text(text: str) -> str:
    """Return ``text`` with the characters XML 1.0 cannot hold replaced (section 2.2).

    And those that would turn text around or steer the terminal somebody reads the file on.
    """
    return _NOT_XML.sub("\ufffd", printable(text))
