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
    from scenario_tui.cli._sut_schema import sut_schema

    models: dict[FileKind, type[Any]] = {
        FileKind.CAMPAIGN: CampaignText,
        FileKind.MISSION: MissionText,
        FileKind.ROBOT: RobotText,
    }
    if kind is FileKind.ORACLES:
        return oracle_schema(_TITLES[kind])
    if kind is FileKind.SUT:
        return sut_schema(_TITLES[kind])
    return editor_schema(models[kind], _TITLES[kind])


def schema_text(kind: FileKind) -> str:
    """Return the schema as the text of its file."""
    import json

    return json.dumps(schema_of(kind), ensure_ascii=False, indent=2) + "\n"
