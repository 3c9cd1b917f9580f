"""Composable models: floor plans and scenery as one graph in the published vocabulary.

Every layer can be written as JSON-LD with the IRIs of the comp-rob2b and secorolab metamodels and
read back, also when others wrote it; layers meet in one rdflib graph, which is validated after
composition. What runs when:

- :func:`check_composition`: layers of our own languages, on every ``scenario check`` (structure
  of the composed graph, no rdflib, no SHACL);
- :func:`load_floorplan_jsonld`, :func:`load_scenery_jsonld`: JSON-LD layers, structure too;
- :func:`validate` and :func:`check_jsonld`: everything, with the SHACL shapes.
"""

from grammars.metamodel._compose import check_composition, compose, decompose, validate
from grammars.metamodel._files import check_jsonld, load_floorplan_jsonld, load_scenery_jsonld
from grammars.metamodel._layer_writer import scenery_document
from grammars.metamodel._plan_writer import composed_document, documents

__all__ = [
    "check_composition",
    "check_jsonld",
    "compose",
    "composed_document",
    "decompose",
    "documents",
    "load_floorplan_jsonld",
    "load_scenery_jsonld",
    "scenery_document",
    "validate",
]
