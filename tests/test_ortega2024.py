"""The tables of the page about the paper: as they are made, and where they go."""

import re

import pytest

from tests.analysis.report.recordings import REPEATS, SHUT, SUTS, record, spec
from tests.ortega2024 import PAGE, count_text, mean_text, number, page_tables, page_with, read_cells


@pytest.fixture(scope="module")
def folders(tmp_path_factory):
    """Repeats of one cell in two folders, the first of them in both."""
    made = [tmp_path_factory.mktemp(name) for name in ("one", "two")]
    for folder, repeats in zip(made, ([0], range(REPEATS)), strict=True):
        for repeat in repeats:
            record(folder / f"{repeat}.mcap", spec(SHUT, SUTS[0], repeat))
    return str(made[0]), str(made[1])


def test_every_marker_of_the_page_has_a_table(folders):
    names = re.findall(r"<!-- table ([a-z-]+)", PAGE.read_text("utf-8"))
    assert set(names) <= set(page_tables(*read_cells(folders[:1], None)))
    assert len(names) == len(set(names)) == PAGE.read_text("utf-8").count("<!-- end of table -->")


def test_folders_are_one_campaign_and_a_repeat_counts_once(folders):
    _, _, row = page_tables(*read_cells(folders, None))["cells"].splitlines()
    columns = [column.strip() for column in row.split("|")[1:-1]]
    # The mission of the recordings is one waypoint that nobody reports; they end, and it is passed.
    assert columns[1:4] == [
        "2 of 2 (16 to 100 %)",
        "20.0 (20.0 to 20.0)",
        "0.110 (−0.017 to 0.237)",
    ]
    assert columns[4:6] == ["0.120", "100.0"]


def test_tables_go_between_their_markers_and_nothing_else_changes(tmp_path):
    page = "a\n<!-- table cells: how -->\nold\n<!-- end of table -->\nb\n"
    assert page_with(page, {"cells": "new\n"}) == page.replace("old", "new")


@pytest.mark.parametrize(
    ("made", "expected"),
    [
        (number(-0.0004, 3), "0.000"),
        (number(-8.94, 1), "−8.9"),
        (mean_text((), 1), "–"),
        (mean_text((4.0,), 1), "4.0"),
        (mean_text((1.0, 2.0, 3.0), 1), "2.0 (−0.5 to 4.5)"),
        (count_text(3, 5), "3 of 5 (15 to 95 %)"),
    ],
)
def test_numbers_say_how_sure_they_are(made, expected):
    assert made == expected
