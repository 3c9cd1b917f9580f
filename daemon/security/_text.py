"""Text from the network that will be shown on somebody's terminal."""

from __future__ import annotations

import re
from typing import Final

_CONTROL: Final = re.compile(
    rb"""(?x)
    (?P<kept> \\ ["\\/nrt] )
    | \\ (?: [bf] | u00 (?: 0[0-8bBcCeEfF] | 1[0-9a-fA-F] | 7[fF] | [89][0-9a-fA-F] ) )
    | \x7f
    | \xc2 [\x80-\x9f]
    """
)
_REPLACEMENT: Final = "\N{REPLACEMENT CHARACTER}".encode()


def tamed(document: bytes) -> bytes:
    r"""Return a JSON document without control characters in its texts, save ``\n \r \t``.

    They move cursors, rename windows and worse; each becomes U+FFFD. JSON allows them only as
    escapes (RFC 8259, section 7), save DEL and the C1 controls, so all can be found without
    parsing.
    """
    return _CONTROL.sub(lambda found: found["kept"] or _REPLACEMENT, document)
