"""The published JSON Schemas are those of the models, and agree with them on what people write."""

import functools
import json
import re
from pathlib import Path

import pytest
from jsonschema import Draft202012Validator

import grammars.editor
from daemon.campaign import CampaignFile, LayerLibrary, LayerReference
from grammars.maps import load_walls
from grammars.model.mission_files import load_mission
from grammars.model.robot_files import load_robot
from grammars.oracle import load_oracles
from grammars.text.diagnostics import InputError, Where
from grammars.text.documents import load_yaml, read_model
from scenario_tui.cli.schema import FILE_KINDS, schema_of, schema_text
from tests.languages.errors.goldens import renew
from tests.languages.plans import HERE

SCHEMAS = Path(grammars.editor.__file__).parent / "schemas"
MODELINE = re.compile(r"# yaml-language-server: \$schema=(\S+)")


@functools.cache
def validator(kind):
    schema = json.loads((SCHEMAS / f"{kind}.schema.json").read_text(encoding="utf-8"))
    Draft202012Validator.check_schema(schema)
    return Draft202012Validator(schema)


@pytest.mark.parametrize("kind", FILE_KINDS)
def test_the_published_schema_is_that_of_the_models(kind):
    published = (SCHEMAS / f"{kind}.schema.json").read_text(encoding="utf-8")
    assert published == schema_text(schema_of(kind)), (
        "the models have changed: scenario schema -o grammars/editor/schemas"
    )


def test_no_schema_is_published_that_nothing_makes():
    assert {p.name for p in SCHEMAS.iterdir()} == {f"{kind}.schema.json" for kind in FILE_KINDS}


def test_every_shipped_file_names_its_schema_and_follows_it(campaigns):
    paths = sorted(campaigns.glob("*/*.yaml"))
    assert len(paths) >= 9
    for path in paths:
        first = path.read_text(encoding="utf-8").partition("\n")[0]
        named = MODELINE.fullmatch(first)
        assert named, f"{path} names no schema in its first line"
        schema = (path.parent / named[1]).resolve()
        assert schema.parent == SCHEMAS.resolve()
        errors = validator(schema.name.partition(".")[0]).iter_errors(load_yaml(path).data)
        assert [f"{path}: {e.json_path}: {e.message}" for e in errors] == []


def test_every_key_is_described():
    for kind in ("campaign", "robot", "sut"):
        schema = validator(kind).schema
        bodies = [schema, *schema["$defs"].values()]
        for body in bodies:
            for key, value in body["properties"].items():
                assert "description" in value or "$ref" in value, (kind, key)
        assert all(body["description"] for body in bodies)


READERS = {
    "robot": load_robot,
    "mission": load_mission,
    "oracles": load_oracles,
    "walls": load_walls,
}


def read(path):
    """Read a file as the program does; a campaign without its layers."""
    kind = path.name.split(".")[1]
    if kind == "campaign":
        read_model(load_yaml(path), CampaignFile)
    elif kind == "sut":
        LayerLibrary(path.parent).sut(LayerReference(path.name, {}, Where("", 1, 1)))
    else:
        READERS[kind](path)


def schema_problems(path):
    """Return where a schema sees problems; the reader refuses those files, and no other.

    The reader of a stack wants files beside it: only the schema looks at ``stack.sut.yaml``.
    """
    errors = validator(path.name.split(".")[1]).iter_errors(load_yaml(path).data)
    places = sorted(f"{error.json_path}\n" for error in errors)
    if places and path.name.startswith("mine"):
        with pytest.raises(InputError):
            read(path)
    elif path.name.startswith("mine"):
        read(path)
    return "".join(places)


def test_schemas_and_readers_agree_on_usual_mistakes(golden, tmp_path):
    golden("schemas.txt", renew(HERE / "schemas.txt", tmp_path / "files", schema_problems))


def _patterns(node):
    if isinstance(node, dict):
        if isinstance(node.get("pattern"), str):
            yield node["pattern"]
        yield from node.get("patternProperties", ())
        node = list(node.values())
    for child in node if isinstance(node, list) else ():
        yield from _patterns(child)


@pytest.mark.parametrize("kind", FILE_KINDS)
def test_expressions_keep_to_what_javascript_understands(kind):
    for pattern in _patterns(validator(kind).schema):
        assert not re.search(r"\(\?[^:=!]|[*+?}]\+|\\[^\w.+*^$?()\[\]{}|/\\]", pattern), pattern
