"""The tutorial of the dashboard is true: its keys lead to what it says one sees."""

import pytest

from tests.people.terminal.first_hour import DOCUMENT, Step, follow, read_steps, shell_in
from tests.people.terminal.pseudo_terminal import ALTERNATE


def test_steps_are_what_stands_in_backquotes_in_the_tables_of_steps():
    text = (
        "`not this`\n\n## Go\n\n| press | you see |\n|---|---|\n| `g` then `⏎` | `a`, or `b c` |\n"
        "| nothing | nor here |\n\n| key | means |\n|---|---|\n| `x` | `y` |\n"
    )
    assert read_steps(text) == (Step(("g", "⏎"), ("a", "b c"), "Go"),)


@pytest.mark.timeout(1200)  # twelve real runs, beside whatever else the machine does
def test_the_keys_of_the_first_hour_lead_to_what_it_says(tmp_path):
    steps = read_steps(DOCUMENT.read_text("utf-8"))
    assert len(steps) > 20

    def report_is_there(step):
        if step.keys == ("o",):
            shell.until(lambda: bool(list((tmp_path / "robot").glob("demo-*.html"))))

    with shell_in(tmp_path) as shell:
        follow(shell, steps, then=report_is_there)
        assert not shell.mode(ALTERNATE)
