"""Reading layers that are written in JSON-LD."""

from __future__ import annotations

from pathlib import Path

from grammars.diagnostics import Diagnostic, InputError, Severity, Where
from grammars.documents import read_text
from grammars.floorplan import FloorPlan
from grammars.metamodel._drift import modernised
from grammars.metamodel._expand import expand_text
from grammars.metamodel._layer_reader import read_layers
from grammars.metamodel._nodes import Nodes
from grammars.metamodel._plan_reader import read_plan
from grammars.metamodel._rules import check, refuse_broken
from grammars.metamodel._vocabulary import FP
from grammars.scenery import SceneryLayer


def load_nodes(path: str | Path) -> Nodes:
    """Read a JSON-LD file, or every ``*.json`` of a folder, into one graph.

    Raises :class:`InputError` with everything that cannot be read; warnings are in ``findings``.
    """
    file = Path(path)
    files = [file]
    if file.is_dir():
        files = sorted(p for p in file.iterdir() if p.suffix == ".json")
        if not files:
            raise InputError(Diagnostic(Where(str(path)), "there is no .json file in this folder"))
    nodes = Nodes()
    problems: list[Diagnostic] = []
    for each in files:
        try:
            nodes.merge(expand_text(read_text(each), str(each)))
        except InputError as error:
            problems.extend(error.diagnostics)
    if problems:
        raise InputError(problems)
    return modernised(nodes)


def load_floorplan_jsonld(path: str | Path) -> FloorPlan:
    """Read a floor plan from JSON-LD in the published vocabulary: one file, or a folder of them.

    The graph is checked as a whole first (:func:`grammars.metamodel.validate`). Raises
    :class:`InputError` with everything that is wrong; warnings are in the plan.
    """
    nodes = load_nodes(path)
    refuse_broken(nodes)
    return read_plan(nodes, str(path))


def load_scenery_jsonld(path: str | Path, warnings: list[Diagnostic] | None = None) -> SceneryLayer:
    """Read a scenery layer from JSON-LD: objects, states, instances, and behaviours of ours.

    A file that refers to a floor plan or to objects of other layers is complete without them.
    Names are made such that sentences can say them (``door-instance-1`` is ``door_instance_1``).
    What was read although it was written in an outdated or incomplete way is added to
    ``warnings``. Raises :class:`InputError` with everything that is wrong.
    """
    nodes = load_nodes(path)
    refuse_broken(nodes, partial=True)
    layers = read_layers(nodes, str(path))
    if len(layers) == 1:
        if warnings is not None:
            warnings.extend(dict.fromkeys(nodes.findings))
        return layers[0]
    hint = "an Object, an ObjectInstance or a layer of ours is needed"
    message = f"there are {len(layers)} layers in it" if layers else "there is no scenery in it"
    raise InputError(Diagnostic(Where(str(path)), message, "" if layers else hint))


def check_jsonld(path: str | Path) -> tuple[Diagnostic, ...]:
    """Return everything that is wrong with a JSON-LD file or folder, errors and warnings.

    A floor plan is held to the SHACL shapes as well; a scenery file alone is not a whole graph.
    Raises :class:`InputError` when it cannot be read at all.
    """
    from grammars.metamodel._graph import graph_of
    from grammars.metamodel._shacl import check_shapes

    nodes = load_nodes(path)
    whole = bool(nodes.of_type(FP["FloorPlan"]))
    found = [*nodes.findings, *check(nodes, partial=not whole)]
    if whole:
        found += check_shapes(graph_of(nodes), nodes.places)
    if not any(d.severity is Severity.ERROR for d in found):
        try:
            if whole:
                found += read_plan(nodes, str(path)).warnings
            read_layers(nodes, str(path))
        except InputError as error:
            found += error.diagnostics
        found += nodes.findings
    return tuple(dict.fromkeys(found))
