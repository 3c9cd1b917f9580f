"""Comparing results with others: the baseline options, the compare command, how differences print.

A baseline is another campaign, a file of results, or the last campaign that was as expected.
"""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Final, TypeAlias

import typer

from scenario_tui.cli import completion
from scenario_tui.cli.exit_codes import ExitCode, wrong_usage
from scenario_tui.cli.options import AsJson, Connect, State
from scenario_tui.cli.output import Output, plain_table, say, stdout_console

if TYPE_CHECKING:
    from collections.abc import Sequence

    from rich.table import Table
    from rich.text import Text

    from daemon.judging.assessment import (
        CampaignDifference,
        JudgedCampaign,
        QuantityChange,
        VerdictChange,
    )
    from daemon.model.status import CampaignRow
    from daemon.model.verbs import ClientOpener, DaemonClient
    from scenario_tui.text.results import CampaignResults

LAST_GREEN: Final = "last-green"
DEFAULT_WORSE_BY: Final = 0.1


def check_ratio(value: str | None) -> str | None:
    """Refuse what is no ratio, as wrong usage."""
    if value is not None:
        from grammars.text.quantity import read_as

        with wrong_usage():
            if read_as(value, "ratio") < 0.0:
                raise ValueError(f'"{value}" is negative')
    return value


Baseline: TypeAlias = Annotated[
    str,
    typer.Option(
        "--baseline",
        metavar="CAMPAIGN",
        help="Fail when results are worse than those of this campaign, file of results (JSON), or "
        "last-green. Default: what the campaign file says under gate.",
        autocompletion=completion.baselines,
    ),
]
WorseBy: TypeAlias = Annotated[
    str | None,
    typer.Option(
        "--worse-by",
        metavar="RATIO",
        callback=check_ratio,
        help="How much worse a margin or a duration may be. Default: the gate's, or 10 %.",
    ),
]


def read_ratio(value: str) -> float:
    """Return the ratio of a checked option."""
    from grammars.text.quantity import read_as

    return read_as(value, "ratio")


def is_results_file(name: str) -> bool:
    """Return True if a name means a file of results and no campaign."""
    # Ids of campaigns hold no slash (daemon.model.ids), so there is no need to look at the disk.
    return name.endswith(".json") or "/" in name


def load_judged(name: str, ask: ClientOpener) -> JudgedCampaign:
    """Return the campaign or the file of results of that name."""
    from scenario_tui.cli.results import read_results
    from scenario_tui.cli.target import find_campaign

    if is_results_file(name):
        return read_results(Path(name))
    with ask() as daemon:
        row = find_campaign(daemon, name)
        return _ask_judged(daemon, row)


def compare_with_baseline(
    results: CampaignResults,
    baseline: str,
    worse_by: str | None,
    ask: ClientOpener | None,
) -> CampaignDifference | None:
    """Compare results with what they must not be worse than, if anybody says so.

    ``ask`` opens the daemon that knows other campaigns; without one only a file can be compared
    with. Returns ``None``, and says so, when there is nothing to compare with.
    """
    from daemon.judging.assessment import JudgedCampaign, compare_campaigns

    gate = results.declared.gate
    name = baseline or (gate.baseline if gate else "")
    if not name:
        return None
    if ask is None and not is_results_file(name):
        say(f"not compared with {name}: without a daemon give a file of results as --baseline")
        return None
    # The option, then the gate of the campaign file, then what is usual.
    allowed = gate.worse_by if gate else DEFAULT_WORSE_BY
    if worse_by is not None:
        allowed = read_ratio(worse_by)
    before = _load_baseline(name, results.row, ask)
    if before is None:
        say(f"no earlier campaign {results.row.name} was as expected: nothing to compare with yet")
        return None
    after = JudgedCampaign(results.row.id, results.declared, results.rows)
    return compare_campaigns(before, after, allowed)


def _load_baseline(name: str, row: CampaignRow, ask: ClientOpener | None) -> JudgedCampaign | None:
    from scenario_tui.cli.results import read_results

    if ask is None or is_results_file(name):
        return read_results(Path(name))
    if name != LAST_GREEN:
        return load_judged(name, ask)
    with ask() as daemon:
        return _last_green(daemon, row)


def _last_green(daemon: DaemonClient, row: CampaignRow) -> JudgedCampaign | None:
    """Return the newest campaign of that name, submitted before, with everything as expected."""
    from daemon.judging.assessment import assess

    rows = daemon.campaign_page(name=row.name)
    ids = [candidate.id for candidate in rows]
    # Rows come newest first: what stands behind it was submitted before.
    older = rows[ids.index(row.id) + 1 :] if row.id in ids else rows
    for candidate in older:
        # Judged anew each time: green is what the rules of that campaign say, nobody stores it.
        if candidate.finished:
            judged = _ask_judged(daemon, candidate)
            if assess(judged.declared, judged.records).exit_code == ExitCode.EXPECTED:
                return judged
    return None


def _ask_judged(daemon: DaemonClient, row: CampaignRow) -> JudgedCampaign:
    from daemon.judging.assessment import JudgedCampaign

    return JudgedCampaign(row.id, daemon.declared(row.id), daemon.all_runs(row.id, results=True))


def final_code(results: CampaignResults, between: CampaignDifference | None) -> int:
    """Return the exit code of results, which is that of a finding when they got worse."""
    # A regression is a finding also where everything still is as the campaign expects.
    if between is not None and between.regressed:
        return ExitCode.UNEXPECTED
    return results.assessment.exit_code


MAX_LISTED: Final = 30


class CompareOutput(Output, schema="compare"):
    """Changes from one campaign to the other."""

    comparison: CampaignDifference
    regressed: bool


def compare(
    before: Annotated[
        str,
        typer.Argument(
            metavar="BEFORE",
            help="A campaign, or a file that --json wrote.",
            autocompletion=completion.campaigns_or_results,
        ),
    ],
    after: Annotated[
        str,
        typer.Argument(
            metavar="AFTER",
            help="Another one, compared with it.",
            autocompletion=completion.campaigns_or_results,
        ),
    ],
    worse_by: Annotated[
        str | None,
        typer.Option(
            "--worse-by",
            metavar="RATIO",
            callback=check_ratio,
            help="Fail when a verdict is worse, or a margin or a duration by more than this.",
        ),
    ] = None,
    everything: Annotated[
        bool, typer.Option("--all", help="List what did not change as well.")
    ] = False,
    connect: Connect = "",
    state: State = None,
    as_json: AsJson = False,
) -> None:
    """Compare two campaigns: verdicts, margins, measures, cell by cell.

    Repeats of equal number and seed are paired.
    """
    from daemon.judging.assessment import compare_campaigns as compared
    from scenario_tui.cli.target import DaemonTarget

    ask = DaemonTarget(connect, state).open
    allowed = None if worse_by is None else read_ratio(worse_by)
    difference = compared(load_judged(before, ask), load_judged(after, ask), allowed)
    if as_json:
        CompareOutput(difference, difference.regressed).emit()
    else:
        print_comparison(difference, everything=everything)
    raise typer.Exit(ExitCode.UNEXPECTED if difference.regressed else ExitCode.EXPECTED)


def print_comparison(difference: CampaignDifference, *, everything: bool = False) -> None:
    """Print what changed from one campaign to the other, what got worse first."""
    from grammars.text.words import count_noun

    console = stdout_console()
    console.print(f"{difference.before} → {difference.after}", style="bold", markup=False)
    sides = (
        (difference.before, difference.unfinished_before),
        (difference.after, difference.unfinished_after),
    )
    for name, count in dict(sides).items():
        if count:
            words = f"{name}: {count_noun(count, 'run')} not finished, compared is the rest"
            console.print(words, markup=False, style="yellow", soft_wrap=True)
    for title, cells in (
        ("only before", difference.only_before),
        ("only after", difference.only_after),
    ):
        if cells:
            names = ", ".join(f"{scenario}/{sut}" for scenario, sut in cells)
            console.print(f"{title}: {names}", markup=False, soft_wrap=True)
    for change in sorted(difference.verdicts, key=lambda v: not v.worse):
        console.print(_verdict_text(change), soft_wrap=True)
    shifts = [s for s in difference.shifts if everything or s.changed or s.worse]
    shifts.sort(key=lambda s: (not s.worse, not s.changed))
    if shifts:
        console.print()
        console.print(_shift_table(shifts[:MAX_LISTED]))
        if len(shifts) > MAX_LISTED:
            console.print(f"and {len(shifts) - MAX_LISTED} more")
    # How many were tested is said because Holm's correction depends on it.
    tested = sum(shift.p is not None for shift in difference.shifts)
    quantities = count_noun(tested, "quantity", "quantities")
    changed = sum(shift.changed for shift in difference.shifts)
    console.print(f"\n{quantities} tested (t, Holm at 5 %): {changed} changed", markup=False)
    if difference.worse_by is not None:
        worse = sum(s.worse for s in difference.shifts) + sum(v.worse for v in difference.verdicts)
        console.print(f"{worse} worse by more than {100 * difference.worse_by:g} %", markup=False)
    console.print()


def _verdict_text(change: VerdictChange) -> Text:
    from rich.text import Text

    from scenario_tui.text.formatting import TERMINAL_STYLES, glyph_word

    text = Text("  ")
    sides = ((change.before, change.passed_before), (change.after, change.passed_after))
    for index, (outcome, passed) in enumerate(sides):
        text.append(" → " if index else "")
        if outcome is None:
            text.append("not judged", style="dim")
        else:
            text.append(f"{glyph_word(str(outcome))} {passed}", style=TERMINAL_STYLES[str(outcome)])
    text.append(f"  {change.sut} {change.scenario} {change.oracle}")
    if change.worse:
        text.append("  worse", style="bold red")
    return text


def _shift_table(shifts: Sequence[QuantityChange]) -> Table:
    from rich.text import Text

    titles = ("scenario", "SUT", "quantity", "before", "after", "difference", "Cliff's delta", "p")
    table = plain_table(*titles, "")
    for shift in shifts:
        word = ("worse", "bold red") if shift.worse else ("changed" if shift.changed else "", "")
        table.add_row(*_shift_cells(shift), Text(*word))
    return table


def _shift_cells(shift: QuantityChange) -> tuple[str, ...]:
    from daemon.judging.statistics import effect_magnitude
    from grammars.text.words import format_quantity
    from scenario_tui.text.formatting import margin

    difference = margin(shift.mean, shift.unit)
    if shift.low is not None and shift.high is not None:
        difference += f" [{margin(shift.low, '')}, {margin(shift.high, '')}]"
    pairs = f" n={shift.n}" + (" unpaired" if shift.method == "welch" else "")
    delta = "" if shift.delta is None else f"{shift.delta:+.2f} {effect_magnitude(shift.delta)}"
    return (
        shift.scenario,
        shift.sut,
        shift.quantity if shift.kind != "margin" else f"{shift.quantity} (margin)",
        format_quantity(shift.before, shift.unit),
        format_quantity(shift.after, shift.unit),
        difference + pairs,
        delta.replace("-", "−"),
        "" if shift.p is None else f"{shift.p:.3g}",
    )
