"""The ``@context`` of what is written here: published addresses, or every term written out.

Two habits of published tools are met. PyLD reads ten remote contexts a document by default, and an
object takes more. rdflib applies the terms of a node's first type only, where the standard says
those of all its types: terms that published contexts scope to a type are therefore written out
without a scope, with the same IRIs.
"""

from __future__ import annotations

import functools
from collections.abc import Iterable
from typing import Any, Final

from grammars.jsonld.vocabulary import (
    COORD,
    ITEMS,
    ROB2B_CONTEXTS,
    SCN,
    SECORO_CONTEXTS,
    XSD,
    context_for,
    rob2b,
    secoro,
)

_COORDINATES: Final = {
    **{
        name: {"@id": COORD[name], "@type": "@id"}
        for name in ("of-pose", "of-position", "as-seen-by")
    },
    **{name: {"@id": COORD[name], "@type": XSD["double"]} for name in ("x", "y", "z")},
}


def plan_context(base: str, contexts: Iterable[str]) -> list[Any]:
    """Return the ``@context`` of a plan's file: its base and the published contexts."""
    addresses = list(contexts)
    written: list[Any] = [{"@base": base, "fpm": base}, *addresses]
    if rob2b("geometry/coordinates.json") in addresses:
        written.append(_COORDINATES)
    return written


def plain_context(base: str) -> dict[str, Any]:
    """Return the ``@context`` of a graph in the plan with IRI ``base``: every term, no address."""
    return {"@base": base, "fpm": base, "item": ITEMS, "scn": str(SCN), **_published_terms()}


@functools.cache
def _published_terms() -> dict[str, Any]:
    addresses = [*map(rob2b, ROB2B_CONTEXTS), *map(secoro, SECORO_CONTEXTS)]
    contexts = [context_for(address, set()) for address in addresses]
    terms = [term for context in contexts for term in context.values() if isinstance(term, dict)]
    scoped = [term["@context"] for term in terms if "@context" in term]
    found: dict[str, Any] = {}
    # Of the few terms with two meanings, the one without a scope or of a coordinate is written.
    for context in (*contexts, *scoped):
        for name, term in context.items():
            if isinstance(term, dict):
                term = {key: value for key, value in term.items() if key != "@context"}
            found.setdefault(name, term)
    return found
