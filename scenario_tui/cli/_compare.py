"""The command that compares two campaigns, and how a comparison is told."""

from __future__ import annotations

from typing import TYPE_CHECKING, Annotated

import typer

from scenario_tui.cli import _completion
from scenario_tui.cli._exits import ExitCode
from scenario_tui.cli._gate import checked_ratio
from scenario_tui.cli._options import AsJson, Connect, State

if TYPE_CHECKING:
    from collections.abc import Sequence

    from rich.table import Table
    from rich.text import Text

    from daemon.assessment import Between, Shift, VerdictChange

LISTED = 30


def compare(
    before: Annotated[
        str,
        typer.Argument(
            metavar="BEFORE",
            help="A campaign, or a file that --json wrote.",
            autocompletion=_completion.campaigns_or_results,
        ),
    ],
    after: Annotated[
        str,
        typer.Argument(
            metavar="AFTER",
            help="Another one, compared with it.",
            autocompletion=_completion.campaigns_or_results,
        ),
    ],
    worse_by: Annotated[
        str | None,
        typer.Option(
            "--worse-by",
            metavar="RATIO",
            callback=checked_ratio,
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
    from daemon.assessment import compare as compared
    from scenario_tui.cli._gate import judged, ratio
    from scenario_tui.cli._output import emit
    from scenario_tui.cli._session import Target

    ask = Target(connect, state).open
    allowed = None if worse_by is None else ratio(worse_by)
    found = compared(judged(before, ask), judged(after, ask), allowed)
    if as_json:
        emit("compare", comparison=found, regressed=found.regressed)
    else:
        print_between(found, everything=everything)
    raise typer.Exit(ExitCode.UNEXPECTED if found.regressed else ExitCode.EXPECTED)


def print_between(found: Between, *, everything: bool = False) -> None:
    """Print what changed from one campaign to the other, what got worse first."""
    from scenario_tui.cli._output import out
    from scenario_tui.wording import counted

    console = out()
    console.print(f"{found.before} → {found.after}", style="bold", markup=False)
    for title, cells in (("only before", found.only_before), ("only after", found.only_after)):
        if cells:
            names = ", ".join(f"{scenario}/{sut}" for scenario, sut in cells)
            console.print(f"{title}: {names}", markup=False, soft_wrap=True)
    for change in sorted(found.verdicts, key=lambda v: not v.worse):
        console.print(_verdict(change), soft_wrap=True)
    shown = [s for s in found.shifts if everything or s.changed or s.worse]
    shown.sort(key=lambda s: (not s.worse, not s.changed))
    if shown:
        console.print()
        console.print(_table(shown[:LISTED]))
        if len(shown) > LISTED:
            console.print(f"and {len(shown) - LISTED} more")
    tested = sum(shift.p is not None for shift in found.shifts)
    quantities = counted(tested, "quantity", "quantities")
    changed = sum(shift.changed for shift in found.shifts)
    console.print(f"\n{quantities} tested (t, Holm at 5 %): {changed} changed", markup=False)
    if found.worse_by is not None:
        worse = sum(s.worse for s in found.shifts) + sum(v.worse for v in found.verdicts)
        console.print(f"{worse} worse by more than {100 * found.worse_by:g} %", markup=False)
    console.print()


def _verdict(change: VerdictChange) -> Text:
    from rich.text import Text

    from scenario_tui.wording import STYLES, glyph_word

    text = Text("  ")
    sides = ((change.before, change.passed_before), (change.after, change.passed_after))
    for index, (outcome, passed) in enumerate(sides):
        text.append(" → " if index else "")
        if outcome is None:
            text.append("not judged", style="dim")
        else:
            text.append(f"{glyph_word(str(outcome))} {passed}", style=STYLES[str(outcome)])
    text.append(f"  {change.sut} {change.scenario} {change.oracle}")
    if change.worse:
        text.append("  worse", style="bold red")
    return text


def _table(shifts: Sequence[Shift]) -> Table:
    from rich import box
    from rich.table import Table
    from rich.text import Text

    table = Table(box=box.SIMPLE_HEAD, pad_edge=False, show_edge=False)
    for title in ("scenario", "SUT", "quantity", "before", "after", "difference", "Cliff's delta",
                  "p", ""):  # fmt: skip
        table.add_column(title, overflow="fold")
    for shift in shifts:
        word = ("worse", "bold red") if shift.worse else ("changed" if shift.changed else "", "")
        table.add_row(*_cells(shift), Text(*word))
    return table


def _cells(shift: Shift) -> tuple[str, ...]:
    from daemon.statistics import magnitude
    from scenario_tui.wording import margin, quantity

    difference = margin(shift.mean, shift.unit)
    if shift.low is not None and shift.high is not None:
        difference += f" [{margin(shift.low, '')}, {margin(shift.high, '')}]"
    pairs = f" n={shift.n}" + (" unpaired" if shift.method == "welch" else "")
    delta = "" if shift.delta is None else f"{shift.delta:+.2f} {magnitude(shift.delta)}"
    return (
        shift.scenario,
        shift.sut,
        shift.quantity if shift.kind != "margin" else f"{shift.quantity} (margin)",
        quantity(shift.before, shift.unit),
        quantity(shift.after, shift.unit),
        difference + pairs,
        delta.replace("-", "−"),
        "" if shift.p is None else f"{shift.p:.3g}",
    )
