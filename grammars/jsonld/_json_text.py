"""The text of a document: strict JSON, and where in it an identifier stands."""

from __future__ import annotations

import functools
import json
import re
from collections import Counter
from typing import Any, Final

from grammars.text.diagnostics import InputError, SourceText, Where

_ID: Final = re.compile(r'"(?:@id|id)"\s*:\s*"([^"\\]*)"')


class JsonText:
    """The text of a JSON-LD document, able to tell where an ``@id`` stands in it."""

    def __init__(self, text: str, file: str) -> None:
        self.text = text
        self.file = file

    @functools.cached_property
    def _ids(self) -> dict[str, int]:
        found: dict[str, int] = {}
        for match in _ID.finditer(self.text):
            found.setdefault(match[1], match.start())
        return found

    @functools.cached_property
    def _source(self) -> SourceText:
        return SourceText(self.text, self.file)

    def parsed(self) -> Any:
        """Return the JSON in the text; raises :class:`InputError` when it is none."""
        try:
            return json.loads(self.text, object_pairs_hook=_unique, parse_constant=_refused)
        except json.JSONDecodeError as error:
            where = Where(self.file, error.lineno, error.colno)
            raise InputError.at(where, f"is not JSON: {error.msg}") from error
        except (RecursionError, ValueError) as error:
            reason = str(error) if isinstance(error, ValueError) else "it is nested too deeply"
            if "int_max_str_digits" in reason:
                reason = "a number has thousands of digits"
            raise InputError.at(self._fault(error), f"is not JSON: {reason}") from error

    def _fault(self, error: Exception) -> Where:
        """Return where something stands that the JSON reader refuses without saying where."""
        words = re.search(r'the key ("[^"]*")|^(-?Infinity|NaN)', str(error))
        pattern = r"-?\d{1000,}|[\[{](?:\s*[\[{]){20}"
        if words is not None:
            pattern = re.escape(words[1] or words[2])
        places = [match.start() for match in re.finditer(pattern, self.text)]
        last = words is not None and words[1] is not None
        return self._source.where(places[-1 if last else 0] if places else 0)

    def where(self, id: str) -> Where:
        """Return where an ``@id``, as written, first stands."""
        position = self._ids.get(id)
        if position is None:
            return Where(self.file, 1, 1)
        return self._source.where(position)


def _unique(pairs: list[tuple[str, Any]]) -> dict[str, Any]:
    found = dict(pairs)
    if len(found) < len(pairs):
        twice, _ = Counter(key for key, _ in pairs).most_common(1)[0]
        raise ValueError(f'the key "{twice}" is written twice in one object')
    return found


def _refused(constant: str) -> float:
    raise ValueError(f"{constant} is not a number")
