"""The results of a campaign: as a table with what is not as expected, as JSON, and read back."""

from __future__ import annotations

from rich.text import Text

from daemon.analysis.results import CampaignResults
from daemon.judging.assessment import CampaignDifference
from daemon.model.assessments import Assessment, AssessmentRules
from daemon.model.status import CampaignRow, RunRow
from scenario_tui.cli.output import Output, stdout_console
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
