"""The tables of ``ortega2024.md``, made from a finished campaign.

``python -m campaigns.studies.ortega2024 RESULTS`` prints them. With ``--write`` they replace those
in the page, between its markers, and its two pictures are drawn again. RESULTS is a folder of
`scenario run`, or the name of a campaign of the state directory (``--state``). Several RESULTS are
one campaign with all their runs.

Intervals are 95 %: exact (Clopper, Pearson) for counts, Student's t for means. A run counts as
finished if the robot reports it and has reached its waypoints; times are of finished runs.
"""

import argparse
from dataclasses import dataclass, replace
from pathlib import Path

from campaigns.studies.pages import NOTHING, count_text, mean_text, number, write_tables
from daemon.analysis.report import ReportRun, read_report_data
from daemon.analysis.report.run_maps import draw_run
from daemon.analysis.results import read_results
from daemon.judging.assessment import assess, mission_completed, reference_comparisons
from daemon.judging.statistics import mean_difference, mean_interval
from daemon.model.verdicts import Outcome
from daemon.trace import read_trace
from scenario_tui.cli.report import with_traces
from scenario_tui.source import DaemonTarget, find_campaign, open_source

PAGE = Path(__file__).with_name("ortega2024.md")
DANCE = PAGE.with_name("dance.svg")
ABORT = PAGE.with_name("abort.svg")
_INTO_DANCE, _DANCE_SHOWN, _ABORT_SHOWN = 60.0, 12.0, 30.0
"""Times in the pictures [s]: from the arrival at the goal, of the dance, and before an abort."""


@dataclass(frozen=True, slots=True)
class Cell:
    """A scenario with a system under test, and its runs."""

    scenario: str
    sut: str
    runs: tuple[ReportRun, ...]

    @property
    def finished(self):
        """The runs that ended their mission."""
        return tuple(run for run in self.runs if mission_completed(run.record))

    def measured(self, name, *, finished=False):
        """Return a measure of the report for every run that has it."""
        runs = self.finished if finished else self.runs
        return tuple(r.tracks.measures[name] for r in runs if name in r.tracks.measures)


def read_cells(results, state):
    """Return the cells of a campaign by scenario, their assessment, and the campaign itself."""
    inputs = [_read_input(name, state) for name in results]
    whole = replace(inputs[0][0], rows=tuple(r for each, _ in inputs for r in each.rows))
    data = read_report_data(whole, [spec for _, specs in inputs for spec in specs])
    runs = {}
    for run in data.runs:
        cell = runs.setdefault((run.record.scenario, run.record.sut), {})
        # The same repeat of two campaigns is the same run.
        cell.setdefault(run.record.repeat, run)
    cells = tuple(
        Cell(*name, tuple(run for _, run in sorted(runs[name].items())))
        for name in sorted(runs, key=lambda cell: cell[0])
    )
    records = [run.record for cell in cells for run in cell.runs]
    return cells, assess(whole.declared, records), whole


def _read_input(name, state):
    target = DaemonTarget(state=state)
    with open_source(str(name), target, judge=False) as source:
        results = read_results(source, find_campaign(source, str(name)))
        specs = [source.run(row.id).spec for row in results.rows]
        return with_traces(results, source, target), specs


def _extreme(values, pick, digits):
    return number(pick(values), digits) if values else NOTHING


def cell_table(cells):
    """Yield the rows of every cell."""
    yield (
        "| | finished | time [s] | error [m] | largest [m] | in 2σ [%] | nearest [m] | "
        "in buffer [s] |"
    )
    yield "|---|---|---|---|---|---|---|---|"
    for cell in cells:
        ends = [run.record.ended for run in cell.runs if run not in cell.finished]
        lasting = ends.count("limit")
        other = [f"{lasting} to the limit"] if lasting else []
        other += [f"{len(ends) - lasting} aborted"] if len(ends) > lasting else []
        columns = (
            f"{cell.scenario} {cell.sut}",
            "; ".join((count_text(len(cell.finished), len(cell.runs)), *other)),
            mean_text(cell.measured("duration", finished=True), 1),
            mean_text(cell.measured("error mean"), 3),
            _extreme(cell.measured("error max"), max, 3),
            mean_text([100 * share for share in cell.measured("inside 2 sigma")], 1).partition(" ")[
                0
            ],
            _extreme(cell.measured("min clearance"), min, 3),
            mean_text(cell.measured("time in buffer", finished=True), 1),
        )
        yield f"| {' | '.join(columns)} |"


def reference_table(compared):
    """Yield the values of the paper beside ours; the counts of several cells are summed up."""
    yield "| | | paper | here | difference |"
    yield "|---|---|---|---|---|"
    groups = {}
    for one in compared:
        groups.setdefault(one.reference, []).append(one)
    for reference, group in groups.items():
        text = reference.text.replace("-", "−")
        text = f"{text} ({reference.note})" if reference.note else text
        statistic = "" if reference.statistic in ("mean", "rate") else f", {reference.statistic}"
        quantity = f"{reference.oracle}{statistic}"
        if reference.statistic == "rate" and len(group) > 1:
            passed = sum(round((one.value or 0.0) * one.n) for one in group)
            here = count_text(passed, sum(one.n for one in group))
            where = f"{reference.scenario} {', '.join(reference.suts)}".strip()
            yield f"| {where}, {len(group)} cells | {quantity} | {text} | {here} | |"
            continue
        for one in group:
            here, difference = _value_and_difference(one)
            where = f"{one.scenario} {one.sut}".strip()
            yield f"| {where} | {quantity} | {text} | {here} | {difference} |"


def _value_and_difference(compared):
    reference = compared.reference
    if compared.value is None or compared.n == 0:
        return NOTHING, NOTHING
    if reference.statistic == "rate":
        return count_text(round(compared.value * compared.n), compared.n), ""
    percent = reference.unit == "1"
    factor, unit = (100.0, "%") if percent else (1.0, reference.unit)
    digits = 3 if reference.unit == "m" else 1
    text = number(factor * compared.value, digits)
    if compared.low is not None and compared.high is not None:
        low, high = (number(factor * bound, digits) for bound in (compared.low, compared.high))
        text += f" ({low} to {high})"
    more = factor * (compared.difference or 0.0)
    sign = "+" if more > 0.0 else ""
    return f"{text} {unit}, n={compared.n}", f"{sign}{number(more, digits)} {unit}"


def detour_table(cells, pairs):
    """Yield how much longer the way is after a door has shut, and how much longer it takes."""
    by_name = {(cell.scenario, cell.sut): cell for cell in cells}
    yield (
        "| | way [m] | way, door open [m] | longer by [m] | mean speed [m/s] | "
        "that takes [s] | measured delay [s] |"
    )
    yield "|---|---|---|---|---|---|---|"
    for name, left, right in pairs:
        for sut in dict.fromkeys(sut for _, sut in by_name):
            shut, still = by_name.get((left, sut)), by_name.get((right, sut))
            if shut is None or still is None:
                continue
            ways = [side.measured("path length", finished=True) for side in (shut, still)]
            times = [side.measured("duration", finished=True) for side in (shut, still)]
            if not all(ways):
                continue
            a, b = (mean_interval(way).mean for way in ways)
            speed = b / mean_interval(times[1]).mean
            columns = (
                f"{name}, {sut}", number(a, 1), number(b, 1), number(a - b, 1), number(speed, 3),
                number((a - b) / speed, 0), _delay_text(shut, still),
            )  # fmt: skip
            yield f"| {' | '.join(columns)} |"


def _delay_text(shut, still):
    left, right = (
        {(run.record.repeat,): run.tracks.measures["duration"] for run in side.finished}
        for side in (shut, still)
    )
    # Two bounds of 97.5 % each are a two-sided interval of 95 %.
    difference = mean_difference(left, right, 0.975)
    if difference is None:
        return NOTHING
    low, high = (number(bound, 1) for bound in (difference.low, difference.high))
    return f"{number(difference.mean, 1)} ({low} to {high}), n={difference.n}"


def page_tables(cells, assessment, results):
    """Return the tables of the page by name."""
    compared = reference_comparisons(results.declared.references, assessment)
    of_s1 = [one for one in compared if one.scenario == "S1"]
    pairs = [(c.name, c.left, c.right) for c in results.declared.comparisons]
    tables = {
        "functional": reference_table(of_s1),
        "references": reference_table(one for one in compared if one not in of_s1),
        "detour": detour_table(cells, pairs),
        "cells": cell_table(cells),
        "unexpected": unexpected_table(assessment),
    }
    return {name: "\n".join(rows) + "\n" for name, rows in tables.items()}


def unexpected_table(assessment):
    """Yield unexpected results, for the author of ``expect:``."""
    yield "| not as expected | exit code |"
    yield "|---|---|"
    for surprise in assessment.surprises:
        yield f"| {' '.join(surprise.text.split())} | |"
    yield f"| {len(assessment.surprises)} in all | {assessment.exit_code} |"


def draw_pictures(cells):
    """Draw the longest dance at a goal and the first abort of S3.6; yield a line about each."""
    records = [run.record for cell in cells for run in cell.runs if run.record.trace is not None]
    dances = [(v.evidence.value or 0.0, r, v) for r in records if (v := _failed(r, "settled"))]
    if dances:
        lasted, record, verdict = max(dances, key=lambda dance: dance[0])
        since = (verdict.evidence.time or 0.0) + _INTO_DANCE
        draw_run(Path(str(record.trace)), DANCE, since=since, until=since + _DANCE_SHOWN)
        yield f"{DANCE.name}: {record.scenario} {record.sut} {record.repeat}, {lasted:.0f} s"
    aborts = []
    for record in records:
        if record.scenario == "S3.6" and record.ended == "finished" and _failed(record, "arrived"):
            trace = read_trace(Path(str(record.trace)))
            aborts.append((trace.valid_until, record, trace.progress[-2:][0].time))
    if aborts:
        end, record, leg = min(aborts, key=lambda abort: abort[0])
        draw_run(Path(str(record.trace)), ABORT, since=max(leg, end - _ABORT_SHOWN))
        yield f"{ABORT.name}: {record.scenario} {record.sut} {record.repeat}, at {end:.0f} s"


def _failed(record, oracle):
    verdict = record.verdict(oracle)
    return verdict if verdict is not None and verdict.outcome is Outcome.FAIL else None


def main():
    """Print the tables, or write them into the page."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").partition("\n")[0])
    parser.add_argument("results", nargs="+", help="a folder of traces, or a campaign by name")
    parser.add_argument("--state", type=Path, default=None, help="state directory of a campaign")
    parser.add_argument("--write", action="store_true", help="write them and the pictures")
    options = parser.parse_args()
    cells, assessment, results = read_cells(options.results, options.state)
    tables = page_tables(cells, assessment, results)
    for name, text in tables.items():
        print(f"{name}:\n\n{text}")
    if options.write:
        write_tables(PAGE, tables)
        for line in draw_pictures(cells):
            print(line)


if __name__ == "__main__":
    main()
