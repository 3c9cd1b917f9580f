"""What ``--json`` writes: the fields of every object by the name in its ``schema``.

A field is never taken away nor changed in meaning without a new number behind the name; new ones
may come. The JSON Schema of all of it is what ``scenario schema --outputs`` prints.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import TYPE_CHECKING, Any, Final, TypeAlias

if TYPE_CHECKING:
    from pydantic import BaseModel

Fields: TypeAlias = dict[str, Any]

SCHEMA_TITLE: Final = "Outputs of scenario-tui"
SCHEMA_FILE: Final = "outputs.schema.json"


def schema_identifier(name: str) -> str:
    """Return what stands in the field ``schema`` of an output."""
    return f"scenario/{name}/1"


def outputs_schema() -> dict[str, Any]:
    """Return the JSON Schema (draft 2020-12) of every output, told apart by ``schema``."""
    from pydantic.json_schema import models_json_schema

    models = {name: _output_model(name, fields()) for name, fields in OUTPUTS.items()}
    keys, found = models_json_schema(
        [(model, "serialization") for model in models.values()], by_alias=True, title=SCHEMA_TITLE
    )
    for body in found["$defs"].values():
        if "properties" in body:
            body["required"] = list(body["properties"])  # what has a default is written as well
    each = [keys[model, "serialization"] for model in models.values()]
    dialect = "https://json-schema.org/draft/2020-12/schema"
    return {"$schema": dialect, "title": SCHEMA_TITLE, "oneOf": each, "$defs": found["$defs"]}


def outputs_text() -> str:
    """Return the schema as the text of its file."""
    import json

    return json.dumps(outputs_schema(), ensure_ascii=False, indent=2) + "\n"


def _output_model(name: str, fields: Fields) -> type[BaseModel]:
    """Return the model of a whole output."""
    from typing import Literal

    from pydantic import Field

    return _object_model(
        name, fields, schema_=(Literal[schema_identifier(name)], Field(alias="schema"))
    )


def _object_model(name: str, fields: Fields, **more: Any) -> type[BaseModel]:
    """Return the model of an object with these fields and no others."""
    from pydantic import ConfigDict, create_model

    told: dict[str, Any] = {field: (kind, ...) for field, kind in fields.items()}
    return create_model(name, __config__=ConfigDict(extra="forbid"), **more, **told)


def _status() -> Fields:
    from daemon.model.status import CampaignRow, DaemonOverview, WorkerRow

    return {
        "endpoint": str,
        "overview": DaemonOverview,
        "campaigns": list[CampaignRow],
        "workers": list[WorkerRow],
    }


def _results() -> Fields:
    from daemon.judging.assessment import CampaignDifference
    from daemon.model.assessments import Assessment, AssessmentRules, RunRecord
    from daemon.model.status import CampaignRow, RunRow

    return {
        "campaign": CampaignRow,
        "declared": AssessmentRules,
        "assessment": Assessment,
        "runs": list[RunRow],
        "records": list[RunRecord],
        "comparison": CampaignDifference | None,
    }


def _run() -> Fields:
    from daemon.model.status import RunDetail

    return {"run": RunDetail}


def _logs() -> Fields:
    from daemon.analysis.run_history import RunLogLine, RunStep

    return {
        "run": str,
        "attempts": int,
        "reason": str,
        "steps": list[RunStep],
        "output": list[str],
        "recorded": list[RunLogLine],
    }


def _fetch() -> Fields:
    brought = _object_model("Brought", {"run": str, "path": str, "bytes": int, "sha256": str})
    return {
        "traces": list[brought],  # type: ignore[valid-type]
        "missing": dict[str, str],
        "bytes": int,
        "seconds": float,
    }


def _submit() -> Fields:
    from daemon.model.status import SubmissionReceipt

    return {"receipt": SubmissionReceipt, "endpoint": str}


def _check() -> Fields:
    from grammars.text.diagnostics import Diagnostic

    return {"files": dict[str, list[Diagnostic]]}


def _steer() -> Fields:
    return {"campaign": str, "runs": int}


def _judge() -> Fields:
    from typing import get_type_hints

    from daemon.analysis.rejudge import RejudgedTrace
    from daemon.model.verdicts import Outcome

    change = {
        "oracle": str,
        "change": str,
        "before": Outcome | None,
        "now": Outcome | None,
        "margin_before": float | None,
        "margin_now": float | None,
    }
    changes = {"changes": list[_object_model("JudgedChange", change)]}  # type: ignore[misc]
    trace = _object_model("JudgedTrace", get_type_hints(RejudgedTrace) | changes)
    return {"oracles": str, "traces": list[trace]}  # type: ignore[valid-type]


def _compare() -> Fields:
    from daemon.judging.assessment import CampaignDifference

    return {"comparison": CampaignDifference, "regressed": bool}


def _report() -> Fields:
    return {
        "campaign": str,
        "runs": int,
        "answer": str,
        "exit_code": int,
        "written": dict[str, str],
    }


def _frame() -> Fields:
    from daemon.model.verdicts import Verdict
    from grammars.model.geometry import Point2, Pose2

    return {
        "run": str,
        "trace": str,
        "time": float,
        "start": float,
        "end": float,
        "pose": Pose2,
        "estimate": Pose2 | None,
        "joints": dict[str, float],
        "reached": int,
        "waypoints": int,
        "returns": list[Point2],
        "plan": list[Point2],
        "contacts": list[Point2],
        "verdicts": list[Verdict],
    }


def _plot() -> Fields:
    from daemon.model.verdicts import Verdict

    curve = _object_model(
        "Curve",
        {"name": str, "unit": str, "time": list[float], "values": list[float | None]},
    )
    signals = list[curve]  # type: ignore[valid-type]
    return {"run": str, "trace": str, "signals": signals, "verdicts": list[Verdict]}


def _coverage() -> Fields:
    from daemon.analysis.coverage import Coverage

    return {"coverage": Coverage, "share_of_pairs": float}


def _blame() -> Fields:
    from daemon.analysis.blame import Blame

    return {"blame": Blame, "runs": int, "cached": int, "seconds": float, "saved": str}


def _doctor() -> Fields:
    from daemon.batch.operation import DoctorFinding
    from daemon.batch.paths import Endpoint

    return {"state": str, "endpoint": Endpoint, "findings": list[DoctorFinding]}


def _metrics() -> Fields:
    from daemon.batch.operation import DaemonStatus

    return {"standing": DaemonStatus}


def _gc() -> Fields:
    swept = _object_model(
        "SweptCampaign",
        {"campaign": str, "finished_at": float | None, "traces": int, "bytes": int},
    )
    return {
        "state": str,
        "dry_run": bool,
        "freed": int,
        "kept": int,
        "campaigns": list[swept],  # type: ignore[valid-type]
    }


def _keys() -> Fields:
    from daemon.batch.security import IssuedKey

    return {"folder": str, "keys": list[IssuedKey]}


def _sut() -> Fields:
    from grammars.text.diagnostics import Diagnostic

    return {
        "name": str,
        "kind": str,
        "files": list[str],
        "parameters": dict[str, Any],
        "places": dict[str, str],
        "defaults": dict[str, dict[str, Any]],
        "topics": dict[str, Any] | None,
        "wiring": dict[str, bool] | None,
        "without_effect": dict[str, str],
        "warnings": list[Diagnostic],
    }


def _vary() -> Fields:
    value = _object_model("VariantValue", {"name": str, "value": float, "unit": str})
    values = list[value]  # type: ignore[valid-type]
    variant = _object_model(
        "MadeVariant",
        {"file": str, "outcome": str, "seed": int, "tries": int, "values": values},
    )
    return {
        "variation": str,
        "plan": str,
        "method": str,
        "seed": int,
        "variants": list[variant],  # type: ignore[valid-type]
    }


OUTPUTS: Final[dict[str, Callable[[], Fields]]] = {
    "status": _status,
    "results": _results,
    "run": _run,
    "logs": _logs,
    "submit": _submit,
    "check": _check,
    "cancel": _steer,
    "retry": _steer,
    "pause": _steer,
    "resume": _steer,
    "priority": lambda: {"campaign": str, "priority": int},
    "stop": lambda: {"endpoint": str, "unfinished": int},
    "fetch": _fetch,
    "judge": _judge,
    "compare": _compare,
    "report": _report,
    "picture": lambda: {"trace": str, "written": str},
    "frame": _frame,
    "plot": _plot,
    "coverage": _coverage,
    "blame": _blame,
    "doctor": _doctor,
    "metrics": _metrics,
    "gc": _gc,
    "keys": _keys,
    "sut": _sut,
    "vary": _vary,
    "export": lambda: {"files": list[str]},
}
"""The fields of each output; the types are loaded when they are asked for."""
