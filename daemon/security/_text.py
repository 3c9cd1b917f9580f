"""Text from the network that will be shown on somebody's terminal."""

from __future__ import annotations

import re
from typing import Final

# Every alternative begins with a letter of its own: so the search skips what has none of them.
_CONTROL: Final = re.compile(
    rb'\\["\\/nrt](?:\\["\\/nrt])*'
    rb"|\\[bf]"
    rb"|\\u00(?:0[0-8bBcCeEfF]|1[0-9a-fA-F]|7[fF]|[89][0-9a-fA-F])"
    rb"|\x7f"
    rb"|\xc2[\x80-\x9f]"
)
_HARMLESS: Final = frozenset(rb'"\/nrt')
_REPLACEMENT: Final = "\N{REPLACEMENT CHARACTER}".encode()


def tamed(document: bytes) -> bytes:
    r"""Return a JSON document without control characters in its texts, save ``\n \r \t``.

    They move cursors, rename windows and worse; each becomes U+FFFD. JSON allows them only as
    escapes (RFC 8259, section 7), save DEL and the C1 controls, so all can be found without
    parsing.
    """
    return _CONTROL.sub(_replacement, document)


def _replacement(found: re.Match[bytes]) -> bytes:
    text = found[0]
    # Passed over rather than not found, so that an escaped backslash begins no other escape.
    return text if text[0] == 0x5C and text[1] in _HARMLESS else _REPLACEMENT
