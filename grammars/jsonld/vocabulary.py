"""The published vocabulary: namespaces, a few words of our own, the contexts that define terms.

Contexts are read without a network. Of JSON-LD 1.1 this is the part the published models use:
prefixes, ``@base``, ``@vocab``, ``@id`` and ``@vocab`` coercion, ``@list`` and ``@set`` containers,
contexts scoped to types (all of them, in code-point order of the types, as the standard says) and
to properties.
"""

from __future__ import annotations

import functools
import json
import re
from collections.abc import Iterable
from pathlib import Path
from typing import Any, Final, NamedTuple
from urllib.parse import urljoin

from grammars.text.diagnostics import did_you_mean

_ROB2B: Final = "https://comp-rob2b.github.io/metamodels/"
_SECORO: Final = "https://secorolab.github.io/metamodels/"


class Namespace(str):
    """An IRI that others start with: ``GEOM["vector-x"]`` is one of its terms."""

    __slots__ = ()

    def __getitem__(self, term: object) -> str:
        return f"{self!s}{term}"


GEOM: Final = Namespace(f"{_ROB2B}geometry/structural-entities#")
REL: Final = Namespace(f"{_ROB2B}geometry/spatial-relations#")
COORD: Final = Namespace(f"{_ROB2B}geometry/coordinates#")
KC: Final = Namespace(f"{_ROB2B}kinematic-chain/structural-entities#")
KC_STATE: Final = Namespace(f"{_ROB2B}kinematic-chain/state#")
DYN: Final = Namespace(f"{_ROB2B}newtonian-rigid-body-dynamics/structural-entities#")
POLY: Final = Namespace(f"{_SECORO}geometry/polytope#")
FP: Final = Namespace(f"{_SECORO}floorplan/floorplan#")
OBJ: Final = Namespace(f"{_SECORO}floorplan/object#")
ST: Final = Namespace(f"{_SECORO}floorplan/state#")
GZB: Final = Namespace(f"{_SECORO}gazebo#")
QUDT: Final = Namespace("http://qudt.org/schema/qudt/")
UNIT: Final = Namespace("http://qudt.org/vocab/unit/")
KIND: Final = Namespace("http://qudt.org/vocab/quantitykind/")
XSD: Final = Namespace("http://www.w3.org/2001/XMLSchema#")
RDF: Final = Namespace("http://www.w3.org/1999/02/22-rdf-syntax-ns#")
SCN: Final = Namespace("urn:scenario-tui:scenery#")
"""Our own words: what the published vocabulary has none for."""

UNKNOWN: Final = Namespace("urn:scenario-tui:unknown:")
"""Words that no context of a document defines, where the document has no address."""

PLANS: Final = f"{_SECORO.removesuffix('metamodels/')}models/floorplan/"
"""Where plans are identified: ``<PLANS><plan name>/<element>``."""
ITEMS: Final = "urn:scenario-tui:item:"
"""Where objects, their parts, groups and parameters of scenery layers are identified."""

ROB2B_CONTEXTS: Final = {
    "geometry/structural-entities.json": "structural-entities.json",
    "geometry/spatial-relations.json": "spatial-relations.json",
    "geometry/coordinates.json": "coordinates.json",
    "kinematic-chain/structural-entities.json": "kinematic-chain.json",
    "kinematic-chain/state.json": "joint-state.json",
    "newtonian-rigid-body-dynamics.json": "dynamics.json",
    "newtonian-rigid-body-dynamics/structural-entities.json": "dynamics.json",
    "newtonian-rigid-body-dynamics/coordinates.json": "dynamics.json",
    "qudt.json": "qudt.json",
}
"""Published context documents of comp-rob2b, by path, and ours with the same IRIs."""
SECORO_CONTEXTS: Final = {
    "geometry/coordinates.json": "coordinates-extension.json",
    "geometry/polytope.json": "polytope.json",
    "floorplan/floorplan.json": "floorplan.json",
    "floorplan/object.json": "object.json",
    "floorplan/state.json": "state.json",
    "simulation/gazebo.json": "gazebo.json",
    "qudt.json": "qudt.json",
}
"""Published context documents of secorolab, by path, and ours with the same IRIs."""


_BY_FILE_NAME: Final = {
    f"{name}.json": f"{_SECORO}{folder}/{name}.json"
    for name, folder in (
        ("object", "floorplan"),
        ("state", "floorplan"),
        ("floorplan", "floorplan"),
        ("polytope", "geometry"),
        ("gazebo", "simulation"),
    )
}


def rob2b(path: str) -> str:
    """Return the published address of a comp-rob2b context."""
    return _ROB2B + path


def secoro(path: str) -> str:
    """Return the published address of a secorolab context."""
    return _SECORO + path


def local_name(iri: str) -> str:
    """Return what follows the last ``/``, ``#`` or ``:``."""
    return iri.rsplit("/", 1)[-1].rsplit("#", 1)[-1].rsplit(":", 1)[-1]


_FOLDER: Final = Path(__file__).with_name("contexts")
_KEYWORDS: Final = frozenset(
    f"@{word}"
    for word in (
        *("context", "id", "type", "value", "language", "list", "set", "graph", "base", "vocab"),
        *("container", "version", "included", "index", "reverse", "nest", "none", "json"),
        *("propagate", "protected", "direction", "import", "prefix"),
    )
)
# Contexts of strangers may refer to each other in a circle.
_MOST_CONTEXTS: Final = 64
_SIMPLE: Final = re.compile(r"\w[\w-]*")
# A term is a prefix when its IRI ends so (JSON-LD 1.1: the gen-delim characters of RFC 3986).
_PREFIX_ENDS: Final = (":", "/", "?", "#", "[", "]", "@")


class ContextError(ValueError):
    """A context that cannot be used; the message is for people."""


class Term(NamedTuple):
    """What a key means: its IRI or keyword, how values are read, terms it brings with it."""

    iri: str
    kind: str = ""
    container: str = ""
    scoped: Any = None


class JsonLdContext:
    """An active context: the terms that hold at one place of a document."""

    __slots__ = ("_folder", "_iris", "_typed", "base", "terms", "vocabulary")

    def __init__(self, base: str, vocabulary: str, terms: dict[str, Term | None]) -> None:
        self.base = base
        self.vocabulary = vocabulary
        self.terms = terms
        self._folder = _folder_of(base)
        self._typed: dict[tuple[str, ...], JsonLdContext] = {}
        self._iris: dict[str, str] = {}

    def extended(self, local: Any, notes: set[str], depth: int = 0) -> JsonLdContext:
        """Return this context with a local one on top; raises :class:`ContextError`.

        ``notes`` collects outdated addresses that were used.
        """
        if depth > _MOST_CONTEXTS:
            raise ContextError("contexts are nested too deeply")
        active = self
        for part in local if isinstance(local, list) else [local]:
            if part is None:
                active = JsonLdContext(self.base, "", {})
            elif isinstance(part, str):
                active = active.extended(context_for(part, notes), notes, depth + 1)
            elif isinstance(part, dict):
                active = active._with(part)
            else:
                raise ContextError(f"a context is an object or an address, not {part!r}")
        return active

    def for_types(self, types: Iterable[str], notes: set[str]) -> JsonLdContext:
        """Return the context that holds inside a node of these types (as written)."""
        key = tuple(types)
        found = self._typed.get(key)
        if found is None:
            found = self
            # In code-point order of the types, as JSON-LD 1.1 wants it: the last one wins.
            for name in sorted(set(key)):
                term = self.terms.get(name)
                if term is not None and term.scoped is not None:
                    found = found.extended(term.scoped, notes)
            self._typed[key] = found
        return found

    def iri(self, text: str, *, vocabulary: bool) -> str:
        """Return the IRI a text means: as a term (``vocabulary``) or as an address of a node."""
        if vocabulary:
            term = self.terms.get(text)
            if term is not None:
                return term.iri
        known = self._iris.get(text)
        if known is None:
            known = self._iris[text] = self._resolved(text)
        if vocabulary and self.vocabulary and ":" not in text:
            return self.vocabulary + text
        return known

    def _resolved(self, text: str) -> str:
        prefix, colon, rest = text.partition(":")
        if colon:
            if prefix == "_" or rest.startswith("//"):
                return text
            term = self.terms.get(prefix)
            usable = term is not None and term.iri.endswith(_PREFIX_ENDS)
            return term.iri + rest if term is not None and usable else text
        if not self.base:
            return text
        if self._folder and _SIMPLE.fullmatch(text):
            return self._folder + text
        try:
            return urljoin(self.base, text)
        except ValueError as error:
            raise ContextError(f'"{text}" is no address: {error}') from error

    def completed(self, address: str) -> JsonLdContext:
        """Return this context with what our context for ``address`` defines and this does not."""
        other = JsonLdContext("", "", {}).extended(address, set())
        return JsonLdContext(self.base, self.vocabulary, {**other.terms, **self.terms})

    def _with(self, local: dict[str, Any]) -> JsonLdContext:
        base, vocabulary = self.base, self.vocabulary
        if "@base" in local:
            base = _text(local["@base"], "@base")
        if "@vocab" in local:
            vocabulary = _text(local["@vocab"], "@vocab")
        if "@import" in local:
            raise ContextError("@import is not read here; list the context instead")
        fresh = JsonLdContext(base, vocabulary, dict(self.terms))
        for name in local:
            if not name.startswith("@"):
                fresh._define(name, local, set())
        return fresh

    def _define(self, name: str, local: dict[str, Any], trail: set[str]) -> None:
        if name in trail:
            raise ContextError(f'term "{name}" is defined by itself')
        definition = local[name]
        if definition is None or definition is False:
            self.terms[name] = None
            return
        parts = {"@id": definition} if isinstance(definition, str) else definition
        if not isinstance(parts, dict):
            raise ContextError(f'term "{name}" is defined as {definition!r}')
        if "@reverse" in parts:
            raise ContextError(f'term "{name}" is reversed, which is not read here')
        iri = self._term_iri(name, parts.get("@id", name), local, trail | {name})
        kind = parts.get("@type", "")
        if kind and kind not in _KEYWORDS:
            kind = self._term_iri(name, kind, local, trail | {name})
        container = parts.get("@container", "")
        if isinstance(container, list):
            container = next((c for c in container if c in ("@list", "@set")), "")
        if container not in ("", None, "@list", "@set"):
            raise ContextError(f'term "{name}": container {container!r} is not read here')
        self.terms[name] = Term(iri, kind, container or "", parts.get("@context"))

    def _term_iri(self, name: str, written: Any, local: dict[str, Any], trail: set[str]) -> str:
        text = _text(written, f'term "{name}"')
        if text in _KEYWORDS:
            return text
        prefix, colon, rest = text.partition(":")
        if colon and not rest.startswith("//"):
            if prefix in local and prefix not in trail:
                self._define(prefix, local, trail)
            term = self.terms.get(prefix)
            return text if term is None else term.iri + rest
        if colon:
            return text
        if text != name and text in local:
            self._define(text, local, trail)
        known = self.terms.get(text) if text != name else None
        if known is not None:
            return known.iri
        if not self.vocabulary:
            raise ContextError(f'term "{name}" stands for "{text}", which is no IRI')
        return self.vocabulary + text


def _folder_of(base: str) -> str:
    """Return what names in a base are appended to, or nothing when that takes a real join."""
    plain = "://" in base and "?" not in base and "#" not in base
    return base[: base.rindex("/") + 1] if plain and base.count("/") > 2 else ""


def _text(value: Any, what: str) -> str:
    if value is None:
        return ""
    if not isinstance(value, str):
        raise ContextError(f"{what} is {value!r}, expected text")
    return value


def context_for(address: str, notes: set[str]) -> Any:
    """Return our context for a published address, whatever host and folder it had at the time."""
    if address.startswith("file:"):
        # Files of 2023 name the contexts on the disk of the person who wrote them.
        notes.add(address)
        address = _BY_FILE_NAME.get(address.rpartition("/")[2], address)
    path = address.partition("metamodels/")[2]
    drifted = (
        "/secorolab.github.io/" not in address and "/comp-rob2b.github.io/" not in address
    ) or path.startswith("floor-plan")
    if path in ("floor-plan.json", "floor-plan/floor-plan.json"):
        path = "floorplan/floorplan.json"
    path = path.replace("floor-plan/", "floorplan/")
    if path == "geometry/coordinate-extension.json":
        path, drifted = "geometry/coordinates.json", True
        name: str | None = SECORO_CONTEXTS[path]
    elif "comp-rob2b" in address:
        name = ROB2B_CONTEXTS.get(path)
    else:
        name = SECORO_CONTEXTS.get(path) or (ROB2B_CONTEXTS.get(path) if drifted else None)
    if name is None:
        known = (*ROB2B_CONTEXTS, *SECORO_CONTEXTS)
        hint = did_you_mean(path, known) if path else ""
        raise ContextError(
            f'the context "{address}" is not known here and nothing is fetched'
            + (f"; {hint}" if hint else "")
        )
    if drifted:
        notes.add(address)
    return _ours(name)


@functools.cache
def _contexts_by_type() -> dict[str, str]:
    """Return the address of the one published context that defines a type, by the type's name."""
    found: dict[str, set[str]] = {}
    published = {rob2b(path): name for path, name in ROB2B_CONTEXTS.items()}
    published |= {secoro(path): name for path, name in SECORO_CONTEXTS.items()}
    # Several addresses lead to one context of ours: the first of them names it.
    for name in dict.fromkeys(published.values()):
        address = next(key for key, value in published.items() if value == name)
        for term in _ours(name):
            if term[:1].isupper() or term[:1].isdigit():
                found.setdefault(term, set()).add(address)
    return {term: min(places) for term, places in found.items() if len(places) == 1}


def context_of_type(name: str) -> str:
    """Return the address of the published context that defines a type, or an empty text."""
    return _contexts_by_type().get(name, "")


@functools.cache
def _ours(name: str) -> Any:
    return json.loads((_FOLDER / name).read_text(encoding="utf-8"))["@context"]
