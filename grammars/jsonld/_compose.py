"""Composition: a floor plan and scenery layers become one graph, and the scene comes back.

Also the way from and to files: reading a plan or a layer that is written in JSON-LD, checking it.
"""

from __future__ import annotations

import json
from collections.abc import Sequence
from typing import TYPE_CHECKING

from grammars.floorplan import FloorPlan
from grammars.jsonld._expand import expand_text
from grammars.jsonld._files import (
    ModelPath,
    model_nodes,
    path_text,
    plan_nodes,
    scenery_nodes,
)
from grammars.jsonld._layer_reader import read_layers
from grammars.jsonld._layer_writer import scene_document
from grammars.jsonld._legacy_terms import replace_legacy_terms
from grammars.jsonld._plan_reader import read_plan
from grammars.jsonld._rules import check_structure, refuse_broken
from grammars.jsonld.vocabulary import FP
from grammars.scenery import SceneryLayer
from grammars.text.diagnostics import Diagnostic, InputError, Severity, Where

if TYPE_CHECKING:
    from rdflib import Graph

    from grammars.jsonld.rdf import ModelGraph


def compose(plan: FloorPlan, layers: Sequence[SceneryLayer] = ()) -> ModelGraph:
    """Return a plan and scenery layers, in order, as one rdflib graph.

    Raises :class:`grammars.text.diagnostics.InputError` for objects that cannot be placed.
    """
    from grammars.jsonld.rdf import graph_of

    return graph_of(expand_text(json.dumps(scene_document(plan, layers)), "<graph>"))


def decompose(graph: Graph) -> tuple[FloorPlan, tuple[SceneryLayer, ...]]:
    """Return the plan and the layers a graph describes: the inverse of :func:`compose`.

    Also of a graph others composed. Raises :class:`grammars.text.diagnostics.InputError` with
    everything that cannot be read.
    """
    from grammars.jsonld.rdf import nodes_of

    nodes = replace_legacy_terms(nodes_of(graph))
    return read_plan(nodes, "<graph>"), read_layers(nodes, "<graph>")


def validate(graph: Graph) -> tuple[Diagnostic, ...]:
    """Return everything that is wrong with a composed graph: SHACL, and what SHACL cannot say.

    Every diagnostic names its element, with its place in the text where the graph knows it.
    """
    from grammars.jsonld.rdf import check_shapes, graph_of, nodes_of

    nodes = nodes_of(graph)
    before = len(nodes.diagnostics)
    nodes = replace_legacy_terms(nodes)
    # Shapes are about current names: what was written with old ones is looked at as it is read.
    current = graph if len(nodes.diagnostics) == before else graph_of(nodes)
    nodes.diagnostics.extend(getattr(graph, "diagnostics", ()))
    found = (*nodes.diagnostics, *check_structure(nodes), *check_shapes(current, nodes.places))
    return tuple(dict.fromkeys(found))


def check_composition(
    plan: FloorPlan, layers: Sequence[SceneryLayer] = ()
) -> tuple[Diagnostic, ...]:
    """Return what is wrong with layers of our own languages once they are put together.

    The fast part of :func:`validate`, without rdflib: our writer only produces what fits the
    shapes, so only what depends on the layers' content is looked at.
    """
    nodes = expand_text(json.dumps(scene_document(plan, layers)), "<graph>")
    return tuple(dict.fromkeys((*nodes.diagnostics, *check_structure(nodes))))


def load_floorplan_jsonld(path: ModelPath, base: str = "") -> FloorPlan:
    """Read a floor plan from JSON-LD in the published vocabulary.

    ``path`` is a file, a folder of files, or several files that make one plan. Relative identifiers
    resolve against ``base``, else against the address of their file. The graph is checked as a
    whole first (:func:`grammars.jsonld.validate`). Raises :class:`InputError` with everything that
    is wrong; warnings are in the plan.
    """
    nodes = plan_nodes(path, base)
    refuse_broken(nodes)
    return read_plan(nodes, path_text(path))


def load_scenery_jsonld(
    path: ModelPath, warnings: list[Diagnostic] | None = None, base: str = ""
) -> SceneryLayer:
    """Read a scenery layer from JSON-LD: objects, states, instances, and behaviours of ours.

    ``path`` is a file, a folder of files, or several files that make one layer.
    Relative identifiers resolve against ``base``, else against the address of their file.
    A file that refers to a floor plan or to objects of other layers is complete without them.
    Names are made such that sentences can say them (``door-instance-1`` is ``door_instance_1``).
    What was read although it was written in an outdated or incomplete way is added to
    ``warnings``. Raises :class:`InputError` with everything that is wrong.
    """
    nodes = scenery_nodes(path, base)
    refuse_broken(nodes, partial=True)
    layers = read_layers(nodes, path_text(path))
    if len(layers) == 1:
        if warnings is not None:
            warnings.extend(dict.fromkeys(nodes.diagnostics))
        return layers[0]
    hint = "an Object, an ObjectInstance or a layer of ours is needed"
    message = f"there are {len(layers)} layers in it" if layers else "there is no scenery in it"
    raise InputError.at(Where(path_text(path), 1, 1), message, "" if layers else hint)


def check_jsonld(path: ModelPath, base: str = "") -> tuple[Diagnostic, ...]:
    """Return everything that is wrong with JSON-LD files, errors and warnings.

    ``path`` is a file, a folder of files, or several files that make one graph. A floor plan is
    held to the SHACL shapes as well; a scenery file alone is not a whole graph.
    Raises :class:`InputError` when it cannot be read at all.
    """
    nodes = model_nodes(path, base)
    # A layer alone refers to frames that are elsewhere: SHACL would refuse every one of them.
    whole = bool(nodes.of_type(FP["FloorPlan"]))
    found = [*nodes.diagnostics, *check_structure(nodes, partial=not whole)]
    if whole:
        from grammars.jsonld.rdf import check_shapes, graph_of

        found += check_shapes(graph_of(nodes), nodes.places)
    if not any(d.severity is Severity.ERROR for d in found):
        try:
            if whole:
                found += read_plan(nodes, path_text(path)).warnings
            read_layers(nodes, path_text(path))
        except InputError as error:
            found += error.diagnostics
        found += nodes.diagnostics
    return tuple(dict.fromkeys(found))
