"""Schemas of the output of ``--json``: every answer of the commands, by its name.

No field is removed or changes its meaning without a new number behind the name; new fields may
come. ``scenario schema --outputs`` prints the JSON Schema of all answers.
"""

from __future__ import annotations

from typing import Any, Final

from daemon.analysis.blame import Explanation
from daemon.analysis.coverage import Coverage
from daemon.analysis.history import WrittenHistory
from daemon.analysis.rejudge import Rejudgement
from daemon.analysis.results import ComparedResults
from daemon.analysis.verification import Verifications
from daemon.batch.doctor import Examination
from daemon.batch.ledger import Removal
from daemon.batch.security import KeyList
from daemon.judging.assessment import ComparedCampaigns
from daemon.model.status import Deletion, HandedOver
from daemon.stacks.ros2.checkup import StackCheck
from grammars.maps.map_import import ImportedBuilding
from grammars.variation import WrittenVariants
from scenario_tui.cli import check, daemon, export, new, plot, steer, values
from scenario_tui.cli.answer import ErrorValue, schema_identifier

SCHEMA_TITLE: Final = "Outputs of scenario-tui"
SCHEMA_FILE: Final = "outputs.schema.json"

VALUES: Final[dict[str, type]] = {
    "acknowledge": steer.SteeredRuns,
    "blame": Explanation,
    "cancel": steer.SteeredRuns,
    "compare": ComparedCampaigns,
    "check": check.CheckedFiles,
    "submit": HandedOver,
    "coverage": Coverage,
    "delete": Deletion,
    "doctor": Examination,
    "error": ErrorValue,
    "pause": steer.SteeredRuns,
    "priority": steer.CampaignPriority,
    "resume": steer.SteeredRuns,
    "retry": steer.SteeredRuns,
    "export": export.ExportedFiles,
    "history": WrittenHistory,
    "import": ImportedBuilding,
    "inspection": StackCheck,
    "judge": Rejudgement,
    "plot": plot.Plot,
    "gc": Removal,
    "keys": KeyList,
    "layers": new.LayerList,
    "logs": values.RunLog,
    "new": new.NewCampaign,
    "stop": daemon.LeavingDaemon,
    "search": values.SearchResult,
    "searches": values.Searches,
    "report": values.WrittenReport,
    "results": ComparedResults,
    "run": values.RunSummary,
    "status": values.DaemonStatus,
    "sut": values.ShownSut,
    "vary": WrittenVariants,
    "verify": Verifications,
}
"""The values of answers (:class:`scenario_tui.cli.answer.Answer`) by the name of their schema."""


_LEFT_OUT_WHEN_EMPTY: Final = {
    "Laser": ("name",),
    "CampaignOrigin": ("path",),
    "Robot": ("other_lasers",),
}
"""Fields that JSON leaves out when empty, so that robots with one laser keep their form."""


def outputs_schema() -> dict[str, Any]:
    """Return the JSON Schema (draft 2020-12) of every output, told apart by ``schema``."""
    definitions: dict[str, Any] = {}
    for name, kind in VALUES.items():
        body, inner = _value_schema(name, kind)
        definitions |= {**inner, name: body}
    dialect = "https://json-schema.org/draft/2020-12/schema"
    each = [{"$ref": f"#/$defs/{name}"} for name in VALUES]
    return {"$schema": dialect, "title": SCHEMA_TITLE, "oneOf": each, "$defs": definitions}


def _value_schema(name: str, kind: type) -> tuple[dict[str, Any], dict[str, Any]]:
    """Return the JSON Schema of a value with its field ``schema``, and the definitions it uses."""
    from pydantic import TypeAdapter

    template = "#/$defs/{model}"
    body = TypeAdapter(kind).json_schema(mode="serialization", ref_template=template)
    inner = body.pop("$defs", {})
    if "$ref" in body:  # a recursive type
        body = dict(inner[body["$ref"].rpartition("/")[2]])
    for title, one in (*inner.items(), (kind.__name__, body)):
        if "properties" in one:
            # Pydantic takes fields with a default for optional; we write all except these.
            left_out = _LEFT_OUT_WHEN_EMPTY.get(title, ())
            one["required"] = [key for key in one["properties"] if key not in left_out]
    body["properties"] = {"schema": {"const": schema_identifier(name)}, **body["properties"]}
    body["required"] = ["schema", *body["required"]]
    return body | {"title": name, "additionalProperties": False}, inner
