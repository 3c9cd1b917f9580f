"""Mutations of a text: words, lines and bytes that are dropped, doubled, swapped or replaced."""

import functools
import json
import re

_WORDS = re.compile(rb"\w+(?:[.-]\w+)*|\s+|[^\w\s]")
_STRAYS = tuple(
    sign.encode("utf-8", "surrogatepass")
    for sign in (
        *"()[]{}<>:,.;=+-*/&|!?%@#\"'`~^$\\\n\t\r\0\x1b\x07\x85\ufeff\u2028\u202e\ud800ü²°３",
        *("..", "//", "{0}", "{{", "}}", "%s", "\\x00", "\\e[31m", "\\ud800", "\\U00110000", "\\"),
        *("&a", "*a", "!!x", "<<: ", "- ", ": ", "? ", "---\n", "...\n", "%YAML 1.1\n", "con\0"),
        *("0", "-1", "1e999", "1e-320", "1e", "0x", "1_0", ".5", "5.", ".inf", "-.inf", ".nan"),
        *("true", "null", "~", "yes", "2020-01-01", "12:30", "world", "this", "all", "every"),
        *("not", "always(", "distance(", "/dev/zero", ".", "/", "a/b", "-o", "{}", "[]", "''"),
        *('"\\u0000"', "<a/>", "</a>", "<!--", "]]>", "&lt;", "&#0;", "&x;", "$(eval"),
        *("$(arg x)", "<!DOCTYPE a>"),
        *("0 m", "-1 m", "1e300 m", "1e-300 m", "90 deg", "1e9 rad", "1 m^9", "2 Hz", "1 foo"),
        *("9" * 400, "1" * 5000, "a" * 300, "ä" * 200, "../" * 50),
    )
)
"""What stands where nobody expects it."""


def mutated(rng, seeds, damages):
    """Return one of ``seeds`` after some changes; others lend their words."""
    data = rng.choice(seeds)
    for _ in range(damages):
        data = rng.choice(_CHANGES)(rng, data, rng.choice(seeds))
    return data[:_LONGEST]


_LONGEST = 200_000


def _words(rng, data, other):
    """Replace a word by one of its sort, from this text or another."""
    words = _WORDS.findall(data) or [b""]
    at = rng.randrange(len(words))
    pool = _words_by_sort(other).get(_sort(words[at]), _STRAYS)
    words[at] = rng.choice(pool)
    return b"".join(words)


@functools.lru_cache(maxsize=64)
def _words_by_sort(data):
    words = {}
    for word in _WORDS.findall(data):
        words.setdefault(_sort(word), []).append(word)
    return words


def _sort(word):
    first = word[:1]
    if first.isspace():
        return "blank"
    return "number" if first.isdigit() else "name" if first.isalpha() else "sign"


def _any_words(rng, data, other):
    """Drop, double or swap words."""
    words = _WORDS.findall(data) or [b""]
    at, to = rng.randrange(len(words)), rng.randrange(len(words))
    match rng.randrange(3):
        case 0:
            del words[at]
        case 1:
            words[at], words[to] = words[to], words[at]
        case _:
            words[to:to] = words[at : at + rng.randrange(12)]
    return b"".join(words)


def _stray(rng, data, other):
    """Insert a stray, or put it in place of a word."""
    words = _WORDS.findall(data) or [b""]
    at = rng.randrange(len(words))
    words[at : at + rng.randrange(2)] = [rng.choice(_STRAYS)]
    return b"".join(words)


def _lines(rng, data, other):
    """Drop, double, move or indent lines, or take one from another text."""
    lines = data.splitlines(keepends=True) or [b""]
    at, to = rng.randrange(len(lines)), rng.randrange(len(lines))
    match rng.randrange(5):
        case 0:
            del lines[at : at + rng.randrange(1, 4)]
        case 1:
            lines.insert(to, lines[at])
        case 2:
            lines.insert(to, lines.pop(at))
        case 3:
            lines[at] = rng.choice((b" ", b"  ", b"    ", b"\t")) + lines[at]
        case _:
            lines.insert(to, rng.choice(other.splitlines(keepends=True) or [b""]))
    return b"".join(lines)


def _bytes(rng, data, other):
    """Cut the text off, or change a byte."""
    if rng.randrange(4) == 0 or not data:
        return data[: rng.randrange(len(data) + 1)]
    at = rng.randrange(len(data))
    return data[:at] + bytes([rng.randrange(256)]) + data[at + rng.randrange(2) :]


def _many(rng, data, other):
    """Repeat a part of a line many times, or nest deeply."""
    words = _WORDS.findall(data) or [b""]
    at = rng.randrange(len(words))
    part = words[at : at + rng.randrange(1, 6)]
    times = rng.choice((3, 30, 300, 1500))
    if rng.randrange(2):
        words[at:at] = part * times
    else:
        words.insert(at, rng.choice(_NESTING) * times)
    return b"".join(words)


def _members(rng, data, other):
    """Replace or drop a member of a node, if the text is a graph in JSON; else a word."""
    try:
        document = json.loads(data)
        nodes = document["@graph"]
        node = rng.choice(nodes)
        key = rng.choice([*node, "@id", "of", "@graph", "@reverse"])
        values = [*node.values(), *rng.choice(nodes).values(), *_VALUES]
    except (ValueError, TypeError, LookupError, AttributeError, RecursionError):
        return _words(rng, data, other)
    if rng.randrange(3):
        node[key] = rng.choice(values)
    else:
        node.pop(key, None)
    return json.dumps(document, indent=1).encode()


_VALUES = (None, True, 0, -3.5, 1e308, "", "x", "_:b", "feet", [], {}, [[1]], ["cell", 3],
           {"@id": 5}, {"@value": []}, {"@list": [1]}, {"@type": 3})  # fmt: skip
_NESTING = (b"(", b"[", b"{", b"-", b"not ", b"a: ", b"- ", b'{"a": ', b"<a>", b"a.", b"a+")
_CHANGES = (
    *(_words, _words, _words, _words),
    *(_any_words, _any_words, _stray, _stray, _lines, _lines, _bytes, _many, _members, _members),
)
"""Most changes keep a text close to one that is understood: they get further in."""
