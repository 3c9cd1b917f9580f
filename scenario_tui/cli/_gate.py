"""What results are held against: another campaign, a file, or the last one that was green."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Final, TypeAlias

import typer

from scenario_tui.cli import _completion

if TYPE_CHECKING:
    from daemon.assessment import Between, Judged
    from daemon.protocol import CampaignRow
    from scenario_tui.asking import Daemon, Opener
    from scenario_tui.summary import Results

LAST_GREEN: Final = "last-green"
DEFAULT_WORSE_BY: Final = 0.1


def checked_ratio(value: str | None) -> str | None:
    """Refuse what is no ratio, as wrong usage."""
    if value is not None:
        from grammars.quantity import read_as

        try:
            if read_as(value, "ratio") < 0.0:
                raise ValueError(f'"{value}" is negative')
        except ValueError as error:
            raise typer.BadParameter(str(error)) from error
    return value


Baseline: TypeAlias = Annotated[
    str,
    typer.Option(
        "--baseline",
        metavar="CAMPAIGN",
        help="Fail when results are worse than those of this campaign, file of results (JSON), or "
        "last-green. Default: what the campaign file says under gate.",
        autocompletion=_completion.baselines,
    ),
]
WorseBy: TypeAlias = Annotated[
    str | None,
    typer.Option(
        "--worse-by",
        metavar="RATIO",
        callback=checked_ratio,
        help="How much worse a margin or a duration may be. Default: the gate's, or 10 %.",
    ),
]


def ratio(value: str) -> float:
    """Return the ratio of a checked option."""
    from grammars.quantity import read_as

    return read_as(value, "ratio")


def is_file(name: str) -> bool:
    """Whether a name means a file of results and no campaign."""
    return name.endswith(".json") or "/" in name


def judged(name: str, ask: Opener) -> Judged:
    """Return the campaign or the file of results of that name."""
    from daemon.assessment import Judged
    from scenario_tui.cli._session import find_campaign
    from scenario_tui.cli._told import read_results

    if is_file(name):
        return read_results(Path(name))
    with ask() as daemon:
        row = find_campaign(daemon, name)
        return Judged(row.id, daemon.declared(row.id), daemon.records(row.id))


def hold(
    results: Results,
    baseline: str,
    worse_by: str | None,
    ask: Opener | None,
) -> Between | None:
    """Compare results with what they must not be worse than, if anybody says so.

    ``ask`` opens the daemon that knows other campaigns; without one only a file can be compared
    with. Returns ``None``, and says so, when there is nothing to compare with.
    """
    from daemon.assessment import Judged, compare
    from scenario_tui.cli._output import say

    gate = results.declared.gate
    name = baseline or (gate.baseline if gate else "")
    if not name:
        return None
    if ask is None and not is_file(name):
        say(f"not compared with {name}: without a daemon give a file of results as --baseline")
        return None
    allowed = gate.worse_by if gate else DEFAULT_WORSE_BY
    if worse_by is not None:
        allowed = ratio(worse_by)
    before = _before(name, results.row, ask)
    if before is None:
        say(f"no earlier campaign {results.row.name} was as expected: nothing to compare with yet")
        return None
    after = Judged(results.row.id, results.declared, results.records)
    return compare(before, after, allowed)


def _before(name: str, row: CampaignRow, ask: Opener | None) -> Judged | None:
    from scenario_tui.cli._told import read_results

    if ask is None or is_file(name):
        return read_results(Path(name))
    if name != LAST_GREEN:
        return judged(name, ask)
    with ask() as daemon:
        return _last_green(daemon, row)


def _last_green(daemon: Daemon, row: CampaignRow) -> Judged | None:
    """Return the newest campaign of that name, submitted before, with everything as expected."""
    from daemon.assessment import Judged, assess

    rows = daemon.campaigns()
    ids = [candidate.id for candidate in rows]
    older = rows[ids.index(row.id) + 1 :] if row.id in ids else rows
    for candidate in older:
        if candidate.name == row.name and candidate.finished:
            declared, records = daemon.declared(candidate.id), daemon.records(candidate.id)
            if assess(declared, records).exit_code == 0:
                return Judged(candidate.id, declared, records)
    return None


def final_code(results: Results, between: Between | None) -> int:
    """Return the exit code of results, which is that of a finding when they got worse."""
    from scenario_tui.cli._exits import ExitCode

    if between is not None and between.regressed:
        return ExitCode.UNEXPECTED
    return results.assessment.exit_code
