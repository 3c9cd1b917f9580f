"""What others found: marks in figures, a table of the page, rows of the tables for machines."""

import re
from dataclasses import replace

import pytest

from daemon.analysis.report import write_page
from daemon.model.assessments import ReferenceValue
from tests.analysis.report.recordings import OPEN, SHUT, SUTS

NEAR = SUTS[0]


def reference(scenario, oracle, value, text, **other):
    given = {"statistic": "mean", "unit": "s", "runs": 5} | other
    source = "Somebody & others"
    return ReferenceValue(
        "paper", source, scenario, (NEAR,), oracle, value=value, text=text, **given
    )


REFERENCES = (
    reference(SHUT, "duration", 21.5, "21.5 s ± 0.5 s", deviation=0.5),
    reference(OPEN, "buffer-time", 19.0, "19 s"),
    reference(SHUT, "reached", 0.8, "4 of 5", statistic="rate", unit="1"),
    reference("", "delay", -8.9, "-8.9 s"),
)


@pytest.fixture(scope="module")
def told(data):
    """The campaign with what somebody else found of it."""
    declared = replace(data.input.declared, references=REFERENCES)
    return replace(data, input=replace(data.input, declared=declared))


@pytest.fixture(scope="module")
def told_page(told):
    return write_page(told, (), processes=1)


def figure(page, label):
    (found,) = re.findall(rf'aria-label="{label}".*?(<svg.*?)</div>', page)
    return str(found)


def test_a_value_is_a_diamond_in_the_figure_of_its_measure(told_page, page):
    duration = figure(told_page, "Boxplots of duration by scenario")
    drawing, chart = duration.split("</svg>")
    assert "paper 21.5 s ± 0.5 s</text>" in drawing
    assert "Somebody & others" in chart
    # By what the oracle measures, whatever the campaign calls it.
    buffer = figure(told_page, "Boxplots of time in buffer by scenario")
    assert "paper 19 s" in buffer
    assert "21.5 s" not in buffer
    assert "paper -8.9 s" in figure(told_page, 'What comparisons in s found[^"]*')
    assert "Somebody" not in page


def test_the_page_puts_them_beside_what_was_found(told_page):
    table = told_page[told_page.index('id="references"') :]
    table = table[: table.index("</table>")]
    rows = [
        [re.sub("<[^>]*>", "", cell) for cell in re.findall(r"<t[dh][^>]*>(.*?)</t[dh]>", row)]
        for row in re.findall(r"<tr>(.*?)</tr>", table, re.DOTALL)[1:]
    ]
    assert [row[2:7] for row in rows] == [
        ["duration", "paper 21.5 s ± 0.5 s", "5", "20 s ± 0 s", "20 s to 20 s"],
        ["buffer-time", "paper 19 s", "5", "20 s ± 0 s", "20 s to 20 s"],
        ["reached", "paper 4 of 5", "5", "2 of 2", "15.8 % to 100 %"],
        ["delay", "paper -8.9 s", "5", "0 s ± 0 s", "0 s to 0 s"],
    ]
    assert [row[8] for row in rows] == ["−1.5 s", "+1 s", "–", "+8.9 s"]
