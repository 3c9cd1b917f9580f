"""Checks that ``--json`` writes what ``scenario schema --outputs`` says, no more and no less."""

import json
from functools import cache

from jsonschema import Draft202012Validator

from scenario_tui.cli.output_schemas import outputs_schema


@cache
def _validators():
    schema = outputs_schema()
    bodies = [body for body in schema["$defs"].values() if "properties" in body]
    for body in bodies:
        body["additionalProperties"] = False
    return {
        body["properties"]["schema"]["const"]: Draft202012Validator(
            body | {"$defs": schema["$defs"]}
        )
        for body in bodies
        if "schema" in body["properties"]
    }


def declared(text):
    """Return the object a command wrote; it is the only one and as declared."""
    body = json.loads(text)
    _validators()[body["schema"]].validate(body)
    return body
