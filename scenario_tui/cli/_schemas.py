"""The JSON Schemas of every kind of YAML file people write, from the models that read them."""

from __future__ import annotations

from enum import StrEnum
from typing import Any, Final


class FileKind(StrEnum):
    """The kinds of YAML files; each has a schema file of its name."""

    CAMPAIGN = "campaign"
    MISSION = "mission"
    ROBOT = "robot"
    SUT = "sut"
    ORACLES = "oracles"

    @property
    def file(self) -> str:
        """Name of the published schema."""
        return f"{self.value}.schema.json"


_TITLES: Final = {
    FileKind.CAMPAIGN: "Campaign of scenario-tui",
    FileKind.MISSION: "Mission of scenario-tui",
    FileKind.ROBOT: "Robot of scenario-tui",
    FileKind.SUT: "System under test of scenario-tui",
    FileKind.ORACLES: "Oracles of scenario-tui",
}


def schema_of(kind: FileKind) -> dict[str, Any]:
    """Return the JSON Schema (draft 2020-12) of one kind of file."""
    from daemon.campaign.text import CampaignText
    from grammars.editor import editor_schema, oracle_schema
    from grammars.files import MissionText, RobotText

    models: dict[FileKind, type[Any]] = {
        FileKind.CAMPAIGN: CampaignText,
        FileKind.MISSION: MissionText,
        FileKind.ROBOT: RobotText,
    }
    if kind is FileKind.ORACLES:
        return oracle_schema(_TITLES[kind])
    if kind is FileKind.SUT:
        return _sut_schema(_TITLES[kind])
    return editor_schema(models[kind], _TITLES[kind])


def _sut_schema(title: str) -> dict[str, Any]:
    """Check the parameters of the kinds that ship; those that plug in check their own."""
    from daemon.campaign.suts import SutText
    from daemon.navigation import PilotParameters
    from grammars.editor import editor_schema

    schema = editor_schema(SutText, title)
    pilot = editor_schema(PilotParameters, "Parameters of the pilot")
    del pilot["$schema"]
    takes = {"pilot": {"$ref": "#/$defs/pilot"}, "idle": {"maxProperties": 0}}
    schema["properties"]["kind"]["examples"] = list(takes)
    schema["allOf"] = [
        {
            "if": {"properties": {"kind": {"const": kind}}, "required": ["kind"]},
            "then": {"properties": {"parameters": parameters}},
        }
        for kind, parameters in takes.items()
    ]
    schema["$defs"] = {"pilot": pilot}
    return schema


def schema_text(kind: FileKind) -> str:
    """Return the schema as the text of its file."""
    import json

    return json.dumps(schema_of(kind), ensure_ascii=False, indent=2) + "\n"
