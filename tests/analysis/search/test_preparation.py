"""A search is tried before its first run, and handed over under an id made of its content."""

import shutil
from dataclasses import replace

import pytest

from daemon.campaign import load_campaign
from daemon.model.search_answer import SearchRow
from daemon.search.composition import search_case
from daemon.search.preparation import check_search, prepare_search
from grammars.text.diagnostics import InputError
from scenario_tui.library.checking import check_file

CAMPAIGN = """\
campaign: tiny
limit: 3 min
robot: courier
oracles: navigation
matrix: {sut: [pilot]}
scenarios:
  busy: {floorplan: flat, objects: doors, behaviours: doors_moving, mission: courier,
         oracles: [keeps-clear]}
search:
  s:
    scenario: busy
    minimise: keeps-clear
    method: halton
"""
LATE = """\
  late:
    scenario: busy
    minimise: any
    method: halton
    over: {mission.start.y: -0.2 .. 0.2 m}
"""


def over(closes, opens, *more, such_that=""):
    """The ranges of the times of a door, and what holds of them."""
    ranges = [f"closes: {closes}", f"opens: {opens}", *more]
    lines = ["    over:", *(f"      doors_moving.{one}" for one in ranges)]
    lines += [f"    such that: {such_that}"] if such_that else []
    return "\n".join([*lines, ""])


SOUND = over("4 .. 10 s", "12 .. 20 s")
UNSOUND = over("4 .. 15 s", "13 .. 20 s")
SWINGS = over("4 .. 10 s", "12 .. 20 s", "swing: 50 .. 70 deg/s")
ORDER = "doors_moving.closes + 0.5 s <= doors_moving.opens"
BOTH = "[doors_moving.closes > doors_moving.opens, doors_moving.closes < doors_moving.opens]"
EARLY = "doors_moving.closes < 4.05 s"
CHECKS = {
    "nothing is wrong": (SOUND, {}),
    "an inequality keeps ranges apart": (over("4 .. 20 s", "5 .. 25 s", such_that=ORDER), {}),
    "an end of a range makes no run": (UNSOUND, {}),
    "inequalities leave nothing": (over("4 .. 15 s", "13 .. 20 s", such_that=BOTH), {}),
    "inequalities leave little": (over("4 .. 15 s", "16 .. 20 s", such_that=EARLY), {}),
    "the scenario does not keep to an inequality": (
        over("4 .. 10 s", "12 .. 20 s", such_that="doors_moving.closes > 9 s"),
        {},
    ),
    "an unknown method": (SOUND, {"method": "a; tpe"}),
    "a method that does not fit": (SWINGS, {"method": "boundary"}),
}


@pytest.fixture
def file(folder):
    """A campaign of a sound search."""
    path = folder / "tiny.yaml"
    path.write_text(CAMPAIGN + SOUND)
    return path


def findings(file, rest, changes):
    """Write a search; return what a check says of its task with these changes."""
    file.write_text(CAMPAIGN + rest)
    campaign = load_campaign(file)
    case = search_case(campaign, replace(campaign.searches[0], **changes))
    return "".join(f"{one}\n" for one in check_search(case)).replace(f"{file.parent}/", "")


def test_searches_are_tried_before_their_first_run(file, golden):
    texts = (f"--- {name}\n{findings(file, *search)}" for name, search in CHECKS.items())
    golden("checks.txt", "".join(texts))


def test_a_scenario_that_makes_no_run_is_told_once(file):
    campaign = load_campaign(file)
    (task,) = campaign.searches
    written = (replace(task.parameters[0], written=20.0), task.parameters[1])
    (found,) = check_search(search_case(campaign, replace(task, parameters=written)))
    assert found.message.startswith("s: the scenario as written makes no run")


def test_a_check_of_a_campaign_file_tries_its_searches(file):
    file.write_text(CAMPAIGN + UNSOUND)
    title, found = check_file(file)
    assert title == "1 scenario, 1 run, 1 search"
    assert [one.message for one in found if "makes no run" in one.message]


def test_the_same_search_has_the_same_id(file):
    submission, _, warnings = prepare_search(file)
    assert warnings == ()
    assert submission.name == "tiny-s"
    assert submission.campaign.startswith("tiny-s-")
    assert prepare_search(file, "s")[0] == submission


def test_other_values_are_another_search(file):
    ids = {
        prepare_search(file)[0].campaign,
        prepare_search(file, change=lambda task: replace(task, seed=8))[0].campaign,
        prepare_search(file, change=lambda task: replace(task, runs=61))[0].campaign,
        prepare_search(file, fresh=True)[0].campaign,
        prepare_search(file, fresh=True)[0].campaign,
    }
    assert len(ids) == 5


def test_the_place_of_its_files_does_not_matter_but_their_text_does(file, tmp_path):
    before = prepare_search(file)[0].campaign
    moved = shutil.copytree(file.parent, tmp_path / "moved")
    assert prepare_search(moved / file.name)[0].campaign == before
    with (moved / "courier.mission.yaml").open("a") as mission:
        mission.write("# another one\n")
    assert prepare_search(moved / file.name)[0].campaign != before


@pytest.mark.parametrize(
    ("text", "name", "message"),
    [
        (CAMPAIGN + SOUND + LATE, "", r"several searches\n.*s, late"),
        (CAMPAIGN + SOUND + LATE, "lat", r'no search "lat"\n.*late'),
        (CAMPAIGN[: CAMPAIGN.index("search:")], "", "has no searches"),
        ((CAMPAIGN + SOUND).replace("minimise: keeps-clear", "minimise: nothing"), "", "nothing"),
    ],
)
def test_no_search_is_guessed_nor_handed_over_with_an_error(file, text, name, message):
    file.write_text(text)
    with pytest.raises(InputError, match=message):
        prepare_search(file, name)


def test_a_search_of_several_is_found_by_its_name_and_a_changed_one_is_checked(file):
    file.write_text(CAMPAIGN + SOUND + LATE)
    assert prepare_search(file, "late")[0].task.name == "late"
    with pytest.raises(InputError, match="nonsense"):
        prepare_search(file, "late", change=lambda task: replace(task, method="nonsense"))


def test_a_known_search_goes_on_by_its_id_as_it_was_begun(file):
    begun = prepare_search(file, change=lambda task: replace(task, seed=8)).submission
    row = SearchRow(begun.campaign, begun.name, 0.0, begun.task, "waiting")
    again = prepare_search(file, begun.campaign, find={row.campaign: row}.get)
    assert again.submission == begun
