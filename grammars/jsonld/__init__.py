"""Composable models: floor plans and scenery as one graph in the published vocabulary.

Every layer can be written as JSON-LD with the IRIs of the comp-rob2b and secorolab metamodels and
read back, also when others wrote it; layers meet in one rdflib graph, which is validated after
composition. What runs when:

- :func:`check_composition`: layers of our own languages (structure of the composed graph, no
  rdflib, no SHACL), in the tests of what the product writes;
- :func:`load_floorplan_jsonld`, :func:`load_scenery_jsonld`: JSON-LD layers, structure too;
- :func:`validate` and :func:`check_jsonld`: everything, with the SHACL shapes.
"""

from grammars.jsonld._compose import (
    check_composition,
    check_jsonld,
    compose,
    decompose,
    load_floorplan_jsonld,
    load_scenery_jsonld,
    validate,
)
from grammars.jsonld._expand import expand_text
from grammars.jsonld._files import is_jsonld, model_files
from grammars.jsonld._layer_reader import read_layers
from grammars.jsonld._layer_writer import objects_document, scene_document, scenery_document
from grammars.jsonld._legacy_terms import replace_legacy_terms
from grammars.jsonld._plan_reader import read_plan
from grammars.jsonld._plan_writer import plan_documents
from grammars.jsonld._rules import refuse_broken

__all__ = [
    "check_composition",
    "check_jsonld",
    "compose",
    "decompose",
    "expand_text",
    "is_jsonld",
    "load_floorplan_jsonld",
    "load_scenery_jsonld",
    "model_files",
    "objects_document",
    "plan_documents",
    "read_layers",
    "read_plan",
    "refuse_broken",
    "replace_legacy_terms",
    "scene_document",
    "scenery_document",
    "validate",
]
