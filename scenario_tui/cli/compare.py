"""Comparison of results: baselines, the compare command, printed differences.

A baseline is a campaign, a folder of traces, a file of results, or the last campaign that was as
expected.
"""

from __future__ import annotations

from collections.abc import Sequence
from contextlib import suppress
from functools import partial
from typing import TYPE_CHECKING, Annotated, Final

import typer

from daemon.batch.errors import Refused
from grammars.text.words import count_noun, format_quantity
from scenario_tui.cli import completion
from scenario_tui.cli.answer import Answer, ExitCode
from scenario_tui.cli.options import parse_ratio
from scenario_tui.cli.output import plain_table, print_line, stdout_console
from scenario_tui.source import DaemonTarget, find_campaign, open_source
from scenario_tui.text.formatting import glyph_word, margin

if TYPE_CHECKING:
    from rich.table import Table
    from rich.text import Text

    from daemon.analysis.results import CampaignResults
    from daemon.judging.assessment import (
        CampaignDifference,
        ComparedCampaigns,
        QuantityChange,
        VerdictChange,
    )
    from daemon.model.status import CampaignRow
    from scenario_tui.library.campaign import Campaign

LAST_GREEN: Final = "last-green"
_DEFAULT_WORSE_BY: Final = 0.1
_MOST_LISTED: Final = 30


def compare_with_baseline(
    results: CampaignResults, baseline: str, worse_by: float | None, target: DaemonTarget
) -> CampaignDifference | None:
    """Compare results with the ``baseline``, otherwise with that of the campaign file.

    Returns ``None`` without a baseline, with a message if it has never been green.
    """
    from daemon.judging.assessment import compare_campaigns

    gate = results.declared.gate
    name = baseline or (gate.baseline if gate else "")
    if not name:
        return None
    # The option, then the gate of the campaign file, then the default.
    allowed = gate.worse_by if gate else _DEFAULT_WORSE_BY
    is_last = name == LAST_GREEN
    before = _last_green(results.row, target) if is_last else _read(name, target)
    if before is None:
        what = f"no earlier campaign {results.row.name} was as expected"
        target.say(f"{what}: nothing to compare with yet")
        return None
    allowed = allowed if worse_by is None else worse_by
    return compare_campaigns(before.judged, results.judged, allowed)


def refuse_unknown_baseline(campaign: Campaign, baseline: str, target: DaemonTarget) -> None:
    """Raise before any run if the baseline, or that of the campaign file, does not exist."""
    gate = campaign.checked.declared.gate
    name = baseline or (gate.baseline if gate else "")
    if name not in ("", LAST_GREEN):
        with open_source(name, target, judge=False) as source:
            find_campaign(source, name)


def _read(name: str, target: DaemonTarget) -> CampaignResults:
    """Return the campaign, the folder of traces or the file of results of that name."""
    from daemon.analysis.results import read_results

    with open_source(name, target) as source:
        return read_results(source, find_campaign(source, name))


def _last_green(row: CampaignRow, target: DaemonTarget) -> CampaignResults | None:
    """Return the newest campaign of that name, submitted before, with everything as expected."""
    from daemon.analysis.results import read_results

    # A campaign that runs here may be the first one ever.
    with suppress(Refused), target.read() as source:
        rows = source.campaign_page(name=row.name)
        ids = [one.id for one in rows]
        # Rows come newest first, so the rows behind it were submitted before.
        for candidate in rows[ids.index(row.id) + 1 if row.id in ids else 0 :]:
            if candidate.finished:
                # Judged anew each time: its rules decide, and the answer is not stored.
                results = read_results(source, candidate)
                if results.assessment.exit_code == ExitCode.EXPECTED:
                    return results
    return None


def compare(
    before: Annotated[
        str,
        typer.Argument(
            metavar="BEFORE",
            help="A campaign, a folder of traces, or a file that --json wrote.",
            autocompletion=completion.offers(completion.campaigns, completion.files(".json")),
        ),
    ],
    after: Annotated[
        str,
        typer.Argument(
            metavar="AFTER",
            help="Another one, to compare with BEFORE.",
            autocompletion=completion.offers(completion.campaigns, completion.files(".json")),
        ),
    ],
    target: DaemonTarget,
    worse_by: Annotated[
        float | None,
        typer.Option(
            metavar="RATIO",
            parser=parse_ratio,
            help="Fail if a verdict is worse, or a margin or a duration by more than this.",
        ),
    ] = None,
    everything: Annotated[bool, "--all", "List unchanged quantities as well."] = False,
) -> Answer[ComparedCampaigns]:
    """Compare two campaigns: verdicts, margins, measures, cell by cell.

    Repeats with the same number and seed are paired.
    """
    from daemon.judging.assessment import ComparedCampaigns, compare_campaigns

    sides = _read(before, target), _read(after, target)
    difference = compare_campaigns(sides[0].judged, sides[1].judged, worse_by)
    return Answer(
        "compare",
        ComparedCampaigns(difference, difference.regressed),
        partial(print_comparison, difference, everything=everything),
        ExitCode.UNEXPECTED if difference.regressed else ExitCode.EXPECTED,
    )


def print_comparison(difference: CampaignDifference, *, everything: bool = False) -> None:
    """Print the changes from one campaign to the other, the worse ones first."""
    print_line(f"{difference.before} → {difference.after}", style="bold")
    sides = (
        (difference.before, difference.unfinished_before),
        (difference.after, difference.unfinished_after),
    )
    for name, count in dict(sides).items():
        if count:
            words = f"{name}: {count_noun(count, 'run')} not finished, only the rest is compared"
            print_line(words, style="yellow")
    for title, cells in (
        ("only before", difference.only_before),
        ("only after", difference.only_after),
    ):
        if cells:
            names = ", ".join(f"{scenario}/{sut}" for scenario, sut in cells)
            print_line(f"{title}: {names}")
    for change in sorted(difference.verdicts, key=lambda v: not v.worse):
        print_line(_verdict_text(change))
    shifts = [s for s in difference.shifts if everything or s.changed or s.worse]
    shifts.sort(key=lambda s: (not s.worse, not s.changed))
    if shifts:
        print_line()
        stdout_console().print(_shift_table(shifts[:_MOST_LISTED]))
        if len(shifts) > _MOST_LISTED:
            print_line(f"and {len(shifts) - _MOST_LISTED} more")
    # Holm's correction depends on the number of tests.
    tested = sum(shift.p is not None for shift in difference.shifts)
    quantities = count_noun(tested, "quantity", "quantities")
    changed = sum(shift.changed for shift in difference.shifts)
    print_line(f"\n{quantities} tested (t, Holm at 5 %): {changed} changed")
    if difference.worse_by is not None:
        worse = sum(s.worse for s in difference.shifts) + sum(v.worse for v in difference.verdicts)
        print_line(f"{worse} worse by more than {100 * difference.worse_by:g} %")
    print_line()


def _verdict_text(change: VerdictChange) -> Text:
    from rich.text import Text

    text = Text("  ")
    sides = ((change.before, change.passed_before), (change.after, change.passed_after))
    for index, (outcome, passed) in enumerate(sides):
        text.append(" → " if index else "")
        if outcome is None:
            text.append("not judged", style="dim")
        else:
            text.append(f"{glyph_word(str(outcome))} {passed}", style=str(outcome))
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
