"""The results of a campaign: as a table with what is not as expected, as JSON, and read back."""

from __future__ import annotations

import json
from pathlib import Path

from rich.text import Text

from daemon.judging.assessment import CampaignDifference, JudgedCampaign
from daemon.model.assessments import Assessment, AssessmentRules
from daemon.model.status import CampaignRow, RunRow
from grammars.text import codec
from grammars.text.diagnostics import Finding, InputError, Where
from scenario_tui.cli.answer import schema_identifier
from scenario_tui.cli.output import Output, stdout_console
from scenario_tui.text.results import CampaignResults
from scenario_tui.text.summary import summary_parts


class ResultsOutput(Output, schema="results"):
    """Everything about a campaign, with what it was held against."""

    campaign: CampaignRow
    declared: AssessmentRules
    assessment: Assessment
    runs: tuple[RunRow, ...]
    comparison: CampaignDifference | None


def emit_results(results: CampaignResults, comparison: CampaignDifference | None = None) -> None:
    """Write everything about a campaign as JSON."""
    ResultsOutput(
        results.row,
        results.declared,
        results.assessment,
        results.rows,
        comparison,
    ).emit()


def read_results(path: Path) -> JudgedCampaign:
    """Read what ``--json`` wrote; raises :class:`InputError` for anything else."""
    where = Where(str(path))
    try:
        body = json.loads(path.read_text(encoding="utf-8"))
        if body["schema"] != schema_identifier(ResultsOutput.schema):
            raise ValueError(f"it holds {body['schema']}")
        declared = codec.from_plain(AssessmentRules, body["declared"])
        runs = codec.from_plain(tuple[RunRow, ...], body["runs"])
        return JudgedCampaign(str(body["campaign"]["id"]), declared, runs)
    except OSError as error:
        message = f"cannot be read: {error.strerror}"
        raise InputError(Finding(where, message)) from error
    except (ValueError, KeyError, TypeError) as error:
        hint = "write one with: scenario results CAMPAIGN --json"
        raise InputError(Finding(where, "is no file of results", hint)) from error


def print_summary(results: CampaignResults, *, took: float | None = None) -> None:
    """Print the matrix of cells, the comparisons, and what is not as expected."""
    console = stdout_console()
    for part in summary_parts(results, took=took):
        console.print(part, crop=False)


def print_commands(*commands: tuple[str, str]) -> None:
    """Print what to type next: ``(command, what it does)`` pairs, the purpose where it fits."""
    console = stdout_console()
    width = max(len(command) for command, _ in commands)
    roomy = all(width + len(purpose) + 4 <= console.width for _, purpose in commands)
    for command, purpose in commands:
        line = Text.assemble("  ", (command, "bold cyan"))
        if roomy:
            line.append(f"{'':{width - len(command)}}  {purpose}", style="dim")
        console.print(line, soft_wrap=True)
