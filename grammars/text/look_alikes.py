"""Characters that look like those of our languages, as they come from word processors and pages."""

from __future__ import annotations

import unicodedata
from typing import Final

_SIGNS: Final = {
    **dict.fromkeys("\u2010\u2011\u2012\u2013\u2014\u2015\u2212", "-"),
    **dict.fromkeys("\u201c\u201d\u201e\u00ab\u00bb", '"'),
    **dict.fromkeys("\u2018\u2019\u201a", "'"),
    "\u2264": "<=",
    "\u2265": ">=",
    "\u2260": "!=",
    "\u00d7": "x",
    "\u00b7": "*",
}
# Cyrillic and Greek letters, each with the Latin one.
_LETTERS: Final = dict(
    zip(
        "\u0430\u0435\u043e\u0440\u0441\u0443\u0445\u0456\u0458\u0455"
        "\u0410\u0412\u0415\u041a\u041c\u041d\u041e\u0420\u0421\u0422\u0423\u0425\u0406\u0408\u0405"
        "\u03bf\u03bd\u0391\u0392\u0395\u0396\u0397\u0399\u039a\u039c\u039d\u039f\u03a1\u03a4\u03a5\u03a7",
        "aeopcyxijsABEKMHOPCTYXIJSovABEZHIKMNOPTYX",
        strict=True,
    )
)


def plain_text(text: str) -> str:
    """Return a text with look-alike letters, digits, signs and blanks as plain ones."""
    signs = _SIGNS | _LETTERS
    return unicodedata.normalize("NFKC", "".join(signs.get(sign, sign) for sign in text))


def look_alike(text: str) -> str:
    """Return advice on the first foreign character of a text that looks plain, otherwise empty."""
    if text.isascii() or not plain_text(text).isascii():
        return ""
    sign = next(sign for sign in text if not sign.isascii())
    name = unicodedata.name(sign, "unknown").lower()
    plain = plain_text(sign)
    wanted = "a blank" if plain.isspace() else f'"{plain}"'
    shown = f'"{sign}" is ' if sign.isprintable() else ""
    return f"{shown}U+{ord(sign):04X}, {name}: write {wanted}"
