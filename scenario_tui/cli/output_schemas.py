"""The schemas of what ``--json`` writes: every output of the commands, by the name it carries.

A field is never taken away nor changed in meaning without a new number behind the name; new ones
may come. The JSON Schema of all of it is what ``scenario schema --outputs`` prints.
"""

from __future__ import annotations

import ast
import dataclasses
import inspect
import sys
from functools import cache
from importlib import import_module
from typing import TYPE_CHECKING, Any, Final, Literal, get_type_hints

from daemon.analysis.blame import Explanation
from daemon.analysis.coverage import Coverage
from daemon.analysis.rejudge import Rejudgement
from daemon.analysis.verification import Verifications
from daemon.batch.ledger import Removal
from daemon.batch.operation import Examination
from daemon.batch.security import KeyList
from daemon.stacks.ros2.checkup import StackCheck
from grammars.maps.map_import import ImportedBuilding
from grammars.variation import WrittenVariants
from scenario_tui.cli import (
    compare,
    daemon,
    export_runs,
    new,
    plot,
    report,
    results,
    run_campaigns,
    search,
    show,
    status,
    steer,
    sut,
)
from scenario_tui.cli.answer import schema_identifier
from scenario_tui.cli.output import ErrorValue, Output, OutputPart

if TYPE_CHECKING:
    from types import ModuleType

    from pydantic import BaseModel

SCHEMA_TITLE: Final = "Outputs of scenario-tui"
SCHEMA_FILE: Final = "outputs.schema.json"

_OUTPUTS: Final[tuple[type[Output], ...]] = (
    run_campaigns.SubmitOutput,
    run_campaigns.CheckOutput,
)
"""In the order they are published in."""

OUTPUTS: Final[dict[str, type[Output]]] = {output.schema: output for output in _OUTPUTS}


VALUES: Final[dict[str, type]] = {
    "blame": Explanation,
    "cancel": steer.SteeredRuns,
    "compare": compare.ComparedCampaigns,
    "coverage": Coverage,
    "delete": steer.Deletion,
    "doctor": Examination,
    "error": ErrorValue,
    "pause": steer.SteeredRuns,
    "priority": steer.CampaignPriority,
    "resume": steer.SteeredRuns,
    "retry": steer.SteeredRuns,
    "export": export_runs.ExportedFiles,
    "history": report.WrittenHistory,
    "import": ImportedBuilding,
    "inspection": StackCheck,
    "judge": Rejudgement,
    "plot": plot.Plot,
    "gc": Removal,
    "keys": KeyList,
    "layers": new.LayerList,
    "logs": show.RunLog,
    "new": new.NewCampaign,
    "stop": daemon.LeavingDaemon,
    "search": search.SearchResult,
    "searches": search.Searches,
    "report": report.WrittenReport,
    "results": results.ComparedResults,
    "run": show.RunSummary,
    "status": status.DaemonStatus,
    "sut": sut.ShownSut,
    "vary": WrittenVariants,
    "verify": Verifications,
}
"""The values of answers (:class:`scenario_tui.cli.answer.Answer`) by the name of their schema."""


_LEFT_OUT_WHEN_EMPTY: Final = {
    "Laser": ("name",),
    "CampaignOrigin": ("path",),
    "Robot": ("other_lasers",),
}
"""What JSON leaves out when it is empty, so that robots with one laser stay what they were."""


def outputs_schema() -> dict[str, Any]:
    """Return the JSON Schema (draft 2020-12) of every output, told apart by ``schema``."""
    from pydantic import Field
    from pydantic.json_schema import models_json_schema

    models = []
    for name, output in OUTPUTS.items():
        schema = (Literal[schema_identifier(name)], Field(alias="schema"))
        models.append(_object_model(name, output, _names_of(output.__module__), schema_=schema))
    keys, found = models_json_schema(
        [(model, "serialization") for model in models], by_alias=True, title=SCHEMA_TITLE
    )
    for name, body in found["$defs"].items():
        if "properties" in body:
            # Pydantic takes what has a default for optional; we write every field but those.
            left_out = _LEFT_OUT_WHEN_EMPTY.get(name, ())
            body["required"] = [key for key in body["properties"] if key not in left_out]
    each = [keys[model, "serialization"] for model in models]
    for name, kind in VALUES.items():
        body, inner = _value_schema(name, kind)
        found["$defs"] |= {**inner, name: body}
        each.append({"$ref": f"#/$defs/{name}"})
    dialect = "https://json-schema.org/draft/2020-12/schema"
    return {"$schema": dialect, "title": SCHEMA_TITLE, "oneOf": each, "$defs": found["$defs"]}


def _value_schema(name: str, kind: type) -> tuple[dict[str, Any], dict[str, Any]]:
    """Return the JSON Schema of a value with its field ``schema``, and what it refers to."""
    from pydantic import TypeAdapter

    template = "#/$defs/{model}"
    body = TypeAdapter(kind).json_schema(mode="serialization", ref_template=template)
    inner = body.pop("$defs", {})
    if "$ref" in body:  # a value that refers to its own kind
        body = dict(inner[body["$ref"].rpartition("/")[2]])
    for title, one in (*inner.items(), (kind.__name__, body)):
        if "properties" in one:
            # Pydantic takes what has a default for optional; we write every field but those.
            left_out = _LEFT_OUT_WHEN_EMPTY.get(title, ())
            one["required"] = [key for key in one["properties"] if key not in left_out]
    body["properties"] = {"schema": {"const": schema_identifier(name)}, **body["properties"]}
    body["required"] = ["schema", *body["required"]]
    return body | {"title": name, "additionalProperties": False}, inner


def _object_model(
    title: str, kind: type[OutputPart], names: dict[str, Any], **more: Any
) -> type[BaseModel]:
    """Return the model of an object with the fields of an output, or of a part, and no others."""
    from pydantic import ConfigDict, create_model

    types = get_type_hints(kind, localns=names)
    members: dict[str, Any] = {one.name: (types[one.name], ...) for one in dataclasses.fields(kind)}
    return create_model(title, __config__=ConfigDict(extra="forbid"), **more, **members)


@cache
def _names_of(module_name: str) -> dict[str, Any]:
    """Return what fields of a module's outputs are typed with: imports, and models of parts."""
    module = sys.modules[module_name]
    names = _imports_for_checkers(module)
    # A part may hold parts that stand before it.
    for name, kind in list(vars(module).items()):
        if inspect.isclass(kind) and issubclass(kind, OutputPart) and not issubclass(kind, Output):
            names[name] = _object_model(name, kind, names)
    return names


def _imports_for_checkers(module: ModuleType) -> dict[str, Any]:
    """Make the imports of a module's block ``if TYPE_CHECKING``.

    Commands load libraries when they use them, so what types their fields is not there otherwise.
    """
    lines = [
        line
        for block in ast.parse(inspect.getsource(module)).body
        if isinstance(block, ast.If) and ast.unparse(block.test) == "TYPE_CHECKING"
        for line in block.body
        if isinstance(line, ast.ImportFrom)
    ]
    return {
        one.asname or one.name: getattr(import_module(str(line.module)), one.name)
        for line in lines
        for one in line.names
    }
