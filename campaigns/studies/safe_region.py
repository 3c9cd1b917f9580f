"""The tables and the figure of ``safe-region.md``, made from finished searches.

``python -m campaigns.studies.safe_region RESULTS`` prints the tables. With ``--write`` they replace
those in the page, between its markers, and its figure is drawn again. RESULTS is a folder with the
output of ``scenario search SEARCH --json`` as NAME.json, for each search of
``campaigns/ortega2024/safe_region.yaml``. NAME.seconds beside it may contain two wall clock times:
of the exploration, and until the answer.

The size of a region is estimated from unguided runs alone. The intervals are 95 % (Clopper,
Pearson).
"""

import argparse
import json
from collections import Counter
from dataclasses import dataclass
from pathlib import Path
from statistics import median

from pydantic import TypeAdapter

from campaigns.studies.pages import NOTHING, count_text, number, write_tables
from daemon.analysis.charts import draw_charts, standalone_svg, table
from daemon.model.search_answer import SearchRow
from daemon.model.status import RunRow
from daemon.model.verdicts import Outcome
from daemon.search.answers.sentences import headline

PAGE = Path(__file__).with_name("safe-region.md")
FIGURE = PAGE.with_name("safe-region.svg")
SYSTEMS = ("a2s", "fro-omni")
SPACES = {"door-17": "door 17 (S3.2)", "both-doors": "doors 17 and 12 (S3.3)",
                 "times": "door times (S2)"}  # fmt: skip
"""Searches of both systems over the same points, by the beginning of their names."""
DRAWN = ("door-17", "both-doors")
WORST = "worst-times-a2s"
CRITERIA = {
    "touches nothing": ("no-contact",),
    "outside of the paper's box": ("no-collision",),
    "mission done": ("visited",),
    "touches nothing, mission done": ("no-contact", "visited"),
}
"""Criteria for points, by the oracles that have to pass."""
SAFE, DONE = "touches nothing", "touches nothing, mission done"
ENDINGS = {
    "all well": ("circle", "#000000", 8), "not done": ("circle", "#b8860b", 20),
    "touches": ("cross", "#000000", 40), "as published": ("diamond", "#7b2d8b", 60),
}  # fmt: skip
"""Endings of runs, and the mark of each in the figure: shape, colour, area [px²]."""


@dataclass(frozen=True, slots=True)
class RecordedSearch:
    """A search with its runs in order; ``seconds`` of wall clock for exploration, and in all."""

    row: SearchRow
    rows: tuple[RunRow, ...]
    seconds: tuple[float, ...] = ()

    @property
    def unguided(self):
        """The runs that fill the space, without the scenario as written."""
        return tuple(
            r
            for r in self.rows
            if r.proposal.phase == "explore" and not r.proposal.guided and r.proposal.number
        )

    def passed(self, criterion):
        """Return the number of unguided runs that do well."""
        return sum(does_well(row, criterion) for row in self.unguided)


def read_searches(folder):
    """Return the searches of a folder by name."""
    searches = {}
    for path in sorted(folder.glob("*.json")):
        body = json.loads(path.read_text("utf-8"))
        row = TypeAdapter(SearchRow).validate_python(body["search"])
        rows = TypeAdapter(tuple[RunRow, ...]).validate_python(body["proposals"])
        clock = path.with_suffix(".seconds")
        seconds = tuple(map(float, clock.read_text("utf-8").split())) if clock.exists() else ()
        searches[row.task.name] = RecordedSearch(row, rows, seconds)
    return searches


def does_well(row, criterion):
    """Return whether a run passes all oracles of a criterion; ``ValueError`` without verdicts."""
    by_oracle = {verdict.oracle: verdict.outcome for verdict in row.verdicts}
    outcomes = [by_oracle.get(oracle) for oracle in CRITERIA[criterion]]
    if not set(outcomes) <= {Outcome.PASS, Outcome.FAIL}:
        raise ValueError(f"{row.id} has no verdict of {' and '.join(CRITERIA[criterion])}")
    return all(outcome is Outcome.PASS for outcome in outcomes)


def region_table(searches):
    """Yield the share of each space that does well, by system."""
    yield f"| | runs | {' | '.join(CRITERIA)} |"
    yield f"|---|---|{'---|' * len(CRITERIA)}"
    for space, system, search in _pairs(searches):
        n = len(search.unguided)
        parts = [count_text(search.passed(criterion), n) for criterion in CRITERIA]
        yield f"| {SPACES[space]}, {system} | {n} | {' | '.join(parts)} |"


def paired_table(searches):
    """Yield the number of shared points at which only one system does well.

    The last column is the exact probability of this split, or of a less even one, for systems of
    equal quality (McNemar).
    """
    # Imported here, because every test process reads this file.
    from scipy.stats import binomtest

    first, second = SYSTEMS
    yield f"| | | points | both | {first} alone | {second} alone | neither | p |"
    yield "|---|---|---|---|---|---|---|---|"
    for space, name in SPACES.items():
        for criterion in (SAFE, DONE):
            pairs = _same_points(searches, space, criterion)
            if not pairs:
                continue
            counts = [pairs.count(kind) for kind in
                      ((True, True), (True, False), (False, True), (False, False))]  # fmt: skip
            alone = counts[1] + counts[2]
            p = binomtest(counts[1], alone).pvalue if alone else 1.0
            words = " | ".join(map(str, counts))
            yield f"| {name} | {criterion} | {len(pairs)} | {words} | {_probability(p)} |"


def _probability(p):
    return "< 0.0001" if p < 0.0001 else f"{p:.2g}"


def _same_points(searches, space, criterion):
    sides = [searches.get(f"{space}-{system}") for system in SYSTEMS]
    results = [
        {row.proposal.values: does_well(row, criterion) for row in side.unguided}
        for side in sides
        if side is not None
    ]
    if len(results) < len(SYSTEMS):
        return []
    first, second = results
    return [(first[point], second[point]) for point in first if point in second]


def band_table(searches):
    """Yield the values of each spring parameter between which runs touch something."""
    yield (
        "| | touches with | mission not done, nothing touched, with | smallest margin [m] | "
        "median clearance, nothing touched, mission done [m] |"
    )
    yield "|---|---|---|---|---|"
    for space, system, search in _pairs(searches):
        if space not in DRAWN:
            continue
        touching = [r for r in search.unguided if not does_well(r, SAFE)]
        unfinished = [r for r in search.unguided if does_well(r, SAFE) and not does_well(r, DONE)]
        margins = [m for r in search.unguided if (m := _margin(r)) is not None]
        clear = [m for r in search.unguided if does_well(r, DONE) and (m := _margin(r)) is not None]
        columns = [_ranges(search, touching), _ranges(search, unfinished), number(min(margins), 4),
                   number(median(clear), 3) if clear else NOTHING]  # fmt: skip
        yield f"| {SPACES[space]}, {system} | {' | '.join(columns)} |"


def ending_table(searches):
    """Yield the endings of runs with an unfinished mission, and their next waypoints."""
    yield "| | mission not done | the robot gave up | after [s] | time was up | on the way to |"
    yield "|---|---|---|---|---|---|"
    for space, system, search in _pairs(searches):
        rows = [row for row in search.unguided if not does_well(row, "mission done")]
        own = [row.simulated for row in rows if row.ended == "finished"]
        limit = sum(row.ended == "limit" for row in rows)
        ahead = Counter(
            lead.waypoint for row in rows for lead in row.leads if lead.oracle == "visited"
        )
        columns = (
            f"{len(rows)} of {len(search.unguided)}", str(len(own)),
            f"{min(own):.0f} to {max(own):.0f}" if own else NOTHING, str(limit),
            ", ".join(f"{name} {count}" for name, count in ahead.most_common()) or NOTHING,
        )  # fmt: skip
        yield f"| {SPACES[space]}, {system} | {' | '.join(columns)} |"


def _ranges(search, rows):
    if not rows:
        return NOTHING
    parts = []
    for index, parameter in enumerate(search.row.task.parameters):
        values = [float(row.proposal.values[index]) for row in rows]
        name = parameter.name.rpartition(".")[2]
        parts.append(f"{name} {min(values):g} to {max(values):g} {parameter.unit}")
    return ", ".join(parts)


def _margin(row):
    return next((lead.margin for lead in row.leads if lead.oracle == "no-contact"), None)


def finding_table(searches):
    """Yield the distinct failures of every search, with the run that has the smallest margin."""
    yield "| search | touches | on the way to | runs | smallest margin [m] | in run |"
    yield "|---|---|---|---|---|---|"
    for name, search in _in_order(searches):
        answer = search.row.answer
        for finding in answer.findings if answer is not None else ():
            example = finding.example
            margin = NOTHING if example.value is None else number(example.value.margin, 4)
            yield (
                f"| {name} | {finding.object} | {finding.waypoint} | {finding.count} | {margin} "
                f"| {example.number} |"
            )


def nearest_table(searches):
    """Yield the sentence of the nearest failure of every search, and the results of its repeats."""
    yield "| search | nearest failure | runs for it | fails with other noise |"
    yield "|---|---|---|---|"
    for name, search in _in_order(searches):
        nearest = search.row.answer.nearest if search.row.answer is not None else None
        if nearest is None:
            yield f"| {name} | {NOTHING} | | |"
            continue
        repeated = nearest.confirmed
        often = count_text(repeated.failed, repeated.runs) if repeated is not None else NOTHING
        runs = str(nearest.runs) if nearest.complete else f"{nearest.runs}, all there were"
        yield f"| {name} | {headline(search.row)} | {runs} | {often} |"


def cost_table(searches):
    """Yield the runs and the cost of every search."""
    yield (
        "| search | method | explored | fail | of those drawn | all runs | CPU [s] | "
        "CPU a run [s] | simulated [h] | explored after, answer after [min] |"
    )
    yield f"|{'---|' * 10}"
    for name, search in _in_order(searches):
        explored = [row for row in search.rows if row.proposal.phase == "explore"]
        failed = sum(not does_well(row, SAFE) for row in explored)
        unguided = len(search.unguided)
        times = [row.result.timing for row in search.rows if row.result is not None]
        cpu, simulated = (sum(getattr(t, k) for t in times) for k in ("cpu", "simulated"))
        wall = ", ".join(number(seconds / 60.0, 1) for seconds in search.seconds) or NOTHING
        yield (
            f"| {name} | {search.row.task.method} | {len(explored)} | {failed} "
            f"| {unguided - search.passed(SAFE)} of {unguided} | {len(search.rows)} | {cpu:.0f} "
            f"| {cpu / len(search.rows):.1f} | {simulated / 3600.0:.1f} | {wall} |"
        )


def influence_table(searches):
    """Yield the rank correlations of the door times with the margin, for both systems."""
    sides = [searches.get(f"times-{system}") for system in SYSTEMS]
    influences = [
        {one.parameter: one for one in side.row.answer.influence}
        for side in sides
        if side is not None and side.row.answer is not None
    ]
    yield f"| door time | {' | '.join(SYSTEMS)} |"
    yield f"|---|{'---|' * len(SYSTEMS)}"
    names = dict.fromkeys(name for side in influences for name in side)

    def strength(name):
        return max(abs(side[name].correlation) for side in influences if name in side)

    for name in sorted(names, key=strength, reverse=True):
        values = [
            number(side[name].correlation, 2) if name in side else NOTHING for side in influences
        ]
        yield f"| {name.rpartition('.')[2]} | {' | '.join(values)} |"


def _pairs(searches):
    for space in SPACES:
        for system in SYSTEMS:
            if (search := searches.get(f"{space}-{system}")) is not None:
                yield space, system, search


def _in_order(searches):
    for name in [f"{space}-{system}" for space in SPACES for system in SYSTEMS] + [WORST]:
        if name in searches:
            yield name, searches[name]


def page_tables(searches):
    """Return the tables of the page by name."""
    makers = {
        "regions": region_table, "paired": paired_table, "bands": band_table,
        "endings": ending_table,
        "findings": finding_table, "nearest": nearest_table, "influence": influence_table,
        "cost": cost_table,
    }  # fmt: skip
    return {name: "\n".join(make(searches)) + "\n" for name, make in makers.items()}


def draw_regions(searches):
    """Return the safe regions of both systems side by side as SVG, a row for each space."""
    rows = [
        {"hconcat": [_region_chart(searches[f"{space}-{system}"], space, system)
                     for system in SYSTEMS]}
        for space in DRAWN
        if all(f"{space}-{system}" in searches for system in SYSTEMS)
    ]  # fmt: skip
    (svg,) = draw_charts([{"vconcat": rows, "background": "#ffffff"}], processes=1)
    return standalone_svg(svg)


def _region_chart(search, space, system):
    """Return a chart of the runs of a search over two ranges, with the published point."""
    x, y = search.row.task.parameters
    marks = [
        (*row.proposal.values, _ending(row))
        for row in search.rows
        if row.proposal.phase == "explore" and _margin(row) is not None
    ]
    marks.append((x.written, y.written, "as published"))
    columns = zip(*(mark for mark in marks if None not in mark), strict=True)
    look = {"domain": list(ENDINGS)}
    shapes, colours, sizes = zip(*ENDINGS.values(), strict=True)
    scale = {"type": "log", "domain": [y.low, y.high], "nice": False}
    return {
        "title": f"{system}: {SPACES[space]}", "width": 238, "height": 170,
        "data": table(dict(zip(("x", "y", "run"), columns, strict=True))),
        "mark": {"type": "point", "filled": True, "opacity": 1},
        "encoding": {
            "x": {"field": "x", "type": "quantitative", "title": f"trigger distance [{x.unit}]",
                  "scale": {"domain": [x.low, x.high], "nice": False}},
            "y": {"field": "y", "type": "quantitative", "title": f"spring [{y.unit}]",
                  "scale": scale},
            "shape": {"field": "run", "scale": {**look, "range": shapes}},
            "color": {"field": "run", "scale": {**look, "range": colours}},
            "size": {"field": "run", "scale": {**look, "range": sizes}},
        },
    }  # fmt: skip


def _ending(row):
    if not does_well(row, SAFE):
        return "touches"
    return "all well" if does_well(row, DONE) else "not done"


def main():
    """Print the tables, or write them and the figure."""
    parser = argparse.ArgumentParser(prog="python -m campaigns.studies.safe_region")
    parser.add_argument("results", type=Path, help="a folder with NAME.json of every search")
    parser.add_argument("--write", action="store_true", help="write them and the figure")
    options = parser.parse_args()
    searches = read_searches(options.results)
    tables = page_tables(searches)
    for name, text in tables.items():
        print(f"{name}:\n\n{text}")
    if options.write:
        write_tables(PAGE, tables)
        FIGURE.write_text(draw_regions(searches), encoding="utf-8")


if __name__ == "__main__":
    main()
