"""JSON-LD exchange: floor plans and scenery in the published vocabulary, written and read.

Files use the vocabulary of the comp-rob2b and secorolab metamodels. PyLD expands the documents;
the SHACL shapes in ``shapes/`` define valid models (:mod:`grammars.jsonld.rdf`).
"""

from grammars.jsonld._layer_writer import objects_document, scene_document, scenery_document
from grammars.jsonld._load import check_jsonld, load_floorplan_jsonld, load_scenery_jsonld
from grammars.jsonld._plan_writer import plan_documents

__all__ = [
    "check_jsonld",
    "load_floorplan_jsonld",
    "load_scenery_jsonld",
    "objects_document",
    "plan_documents",
    "scene_document",
    "scenery_document",
]
