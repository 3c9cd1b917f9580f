"""The words of composable models: published namespaces, and the few words of our own."""

from __future__ import annotations

from typing import Final

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


def rob2b(path: str) -> str:
    """Return the published address of a comp-rob2b context."""
    return _ROB2B + path


def secoro(path: str) -> str:
    """Return the published address of a secorolab context."""
    return _SECORO + path


def local_name(iri: str) -> str:
    """Return what follows the last ``/``, ``#`` or ``:``."""
    return iri.rsplit("/", 1)[-1].rsplit("#", 1)[-1].rsplit(":", 1)[-1]
