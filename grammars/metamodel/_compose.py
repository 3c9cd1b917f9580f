"""Composition: a floor plan and scenery layers become one graph, and the scene comes back."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

from grammars.diagnostics import Diagnostic
from grammars.floorplan import FloorPlan
from grammars.metamodel._drift import modernised
from grammars.metamodel._expand import expand
from grammars.metamodel._layer_reader import read_layers
from grammars.metamodel._layer_writer import LayerWriter
from grammars.metamodel._nodes import Nodes, Ref
from grammars.metamodel._plan_reader import read_plan
from grammars.metamodel._plan_writer import FILES, PlanWriter, plan_context
from grammars.metamodel._rules import check
from grammars.metamodel._vocabulary import ITEMS, SCN
from grammars.scenery import SceneryLayer

if TYPE_CHECKING:
    from rdflib import Graph

    from grammars.metamodel._graph import ModelGraph

SCENARIO = f"{ITEMS}scenario"


def composed(plan: FloorPlan, layers: Sequence[SceneryLayer] = ()) -> Nodes:
    """Return what a plan and its layers say together, each node with its place in the texts."""
    writer = PlanWriter(plan)
    nodes = Nodes()
    for name, addresses in FILES.items():
        document = {
            "@context": plan_context(writer.base, addresses),
            "@graph": writer.files[name],
        }
        nodes.merge(expand(document, name))
    nodes.places.update(writer.places)
    for layer in layers:
        layer_writer = LayerWriter(layer, writer, layers)
        nodes.merge(expand(layer_writer.document(), layer.file))
        nodes.places.update(layer_writer.places)
    if layers:
        scenario = nodes.get(SCENARIO)
        scenario.add_type(SCN["Scenario"])
        scenario.add(SCN["layers"], tuple(Ref(f"{ITEMS}layer.{layer.name}") for layer in layers))
    return nodes


def compose(plan: FloorPlan, layers: Sequence[SceneryLayer] = ()) -> ModelGraph:
    """Return a plan and scenery layers, in order, as one rdflib graph.

    The graph knows where its nodes were written (``graph.places``). Raises
    :class:`grammars.diagnostics.InputError` for objects that cannot be placed.
    """
    from grammars.metamodel._graph import graph_of

    return graph_of(composed(plan, layers))


def decompose(graph: Graph) -> tuple[FloorPlan, tuple[SceneryLayer, ...]]:
    """Return the plan and the layers a graph describes: the inverse of :func:`compose`.

    Also of a graph others composed. Raises :class:`grammars.diagnostics.InputError` with
    everything that cannot be read.
    """
    from grammars.metamodel._graph import nodes_of

    nodes = modernised(nodes_of(graph))
    return read_plan(nodes, "<graph>"), read_layers(nodes, "<graph>")


def validate(graph: Graph) -> tuple[Diagnostic, ...]:
    """Return everything that is wrong with a composed graph: SHACL, and what SHACL cannot say.

    Every diagnostic names its element, with its place in the text where the graph knows it.
    """
    from grammars.metamodel._graph import graph_of, nodes_of
    from grammars.metamodel._shacl import check_shapes

    nodes = nodes_of(graph)
    before = len(nodes.findings)
    nodes = modernised(nodes)
    # Shapes are about current names: what was written with old ones is looked at as it is read.
    current = graph if len(nodes.findings) == before else graph_of(nodes)
    nodes.findings.extend(getattr(graph, "findings", ()))
    found = (*nodes.findings, *check(nodes), *check_shapes(current, nodes.places))
    return tuple(dict.fromkeys(found))


def check_composition(
    plan: FloorPlan, layers: Sequence[SceneryLayer] = ()
) -> tuple[Diagnostic, ...]:
    """Return what is wrong with layers of our own languages once they are put together.

    The fast part of :func:`validate`, without rdflib: our writer only produces what fits the
    shapes, so only what depends on the layers' content is looked at.
    """
    nodes = composed(plan, layers)
    return tuple(dict.fromkeys((*nodes.findings, *check(nodes))))
