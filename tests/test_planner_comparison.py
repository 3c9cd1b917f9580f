"""The tables of the page about the quicker planner: what they say of pairs of runs."""

import json
import re

from daemon.campaign import expand, load_campaign
from tests.planner_comparison import (
    CAMPAIGN,
    PAGE,
    number_text,
    page_with,
    places,
    planned_by,
    read_pairs,
    summary,
    table,
)


def row(cpu, duration, **verdicts):
    measures = {"duration": duration, "distance": 2.0, "loc-mean": 0.1}
    return {"cpu": cpu, "simulated": 10.0, "verdicts": verdicts, "measures": measures}


PAIRS = [
    {"exact": row(2.0, 10.0, arrived="pass", visited="pass"),
     "incremental": row(1.0, 11.0, arrived="fail", visited="pass")},
    {"exact": row(4.0, 12.0, arrived="pass", visited="fail"),
     "incremental": row(1.0, None, arrived="pass", visited="fail")},
]  # fmt: skip


def test_every_cell_of_the_campaign_is_compared():
    once = places(1)
    assert len(once) == len({(place.scenario, place.sut) for place in once}) == 24
    assert len({place.file for place in places(5)}) == 120


def test_only_the_planner_differs_within_a_pair():
    spec = expand(load_campaign(CAMPAIGN)).runs[0]
    assert planned_by(spec, "exact") is spec
    quick = planned_by(spec, "incremental")
    assert quick.sut.parameters == spec.sut.parameters | {"planner": "incremental"}
    assert (quick.seed, quick.scene, quick.sut.name) == (spec.seed, spec.scene, spec.sut.name)


def test_rows_say_where_verdicts_differ_and_how_much_quicker_it_was():
    _, _, line = table({("S1", "a2s"): PAIRS}).splitlines()
    columns = [column.strip() for column in line.split("|")[1:-1]]
    assert columns == [
        "S1", "a2s", "2", "arrived 2 → 1 of 2", "11.0 ± 1.4 → 11.0", "2.0 ± 0.0 → 2.0 ± 0.0",
        "0.100 ± 0.000 → 0.100 ± 0.000", "3.0 ± 1.4 → 1.0 ± 0.0", "3.00",
    ]  # fmt: skip
    assert number_text([None], 1) == "–"


def test_the_summary_counts_runs_and_verdicts():
    _, _, line = summary({("S1", "a2s"): PAIRS}).splitlines()
    columns = [column.strip() for column in line.split("|")[1:-1]]
    assert columns == ["1", "2", "1", "4", "3", "6 → 2", "3 → 10", "3.00"]


def test_what_was_run_before_is_not_run_again(tmp_path):
    place = places(1)[0]
    (tmp_path / place.file).write_text(json.dumps(PAIRS[0]))
    assert read_pairs(tmp_path, 1) == {(place.scenario, place.sut): PAIRS[:1]}


def test_the_page_has_a_place_for_every_table():
    page = PAGE.read_text("utf-8")
    assert re.findall(r"<!-- table ([a-z]+)", page) == ["summary", "cells"]
    written = page_with(page, {"summary": "one\n", "cells": "two\n"})
    assert "one\n<!-- end of table -->" in written
    assert page_with(written, {"summary": "", "cells": ""}).count("<!-- end of table -->") == 2
