"""A point of a search is the run that a campaign specifies with the point's values written in."""

import shutil
from dataclasses import replace

import pytest

from daemon.analysis.blame import Candidate
from daemon.campaign import expand, load_campaign
from daemon.model.search_answer import SearchRow
from daemon.search.composition import search_case
from daemon.search.point_runner import PointRunner
from daemon.search.preparation import check_search, prepare_search
from daemon.search.program import missing_words, run_search, shrink_failure
from grammars.model.behaviour import Trigger
from grammars.text.diagnostics import InputError
from scenario_tui.library.checking import check_file
from tests.analysis.search.searches import LocalRuns, load_search_case, made_trial, result_of
from tests.analysis.search.tasks import ORACLE

CAMPAIGN = """\
campaign: tiny
seed: 3
repeats: 3
limit: 3 min
robot: courier
oracles: navigation
matrix: {sut: [pilot, idle]}
defaults:
  floorplan: flat
  objects: doors
  mission: courier
  oracles: [keeps-clear, nearest]
  chance: per repeat
scenarios:
"""
BUSY = "  busy: {behaviours: [doors_open, doors_moving]}\n"
TIMES = """\
  busy: {behaviours: [doors_open, doors_moving]}
  calm: {behaviours: doors_open}
compare: {patience: delay(busy vs calm on leg kitchen) <= 9 s}
search:
  s:
    scenario: busy
    sut: pilot
    minimise: keeps-clear
    method: halton
    over:
      doors_moving.closes: 4 .. 20 s
      doors_moving.opens: 5 .. 25 s
      doors_moving.swing: 48 .. 72 deg/s
      doors_moving.leading: [bedroom_door, kitchen_door]
"""
WRITTEN = (6.0, 14.0, 60.0, "bedroom_door")
OTHER = (6.25, 15.0, 52.5, "kitchen_door")
OTHER_BUSY = """\
  s.7: {behaviours: [doors_open, doors_moving: {closes: 6.25 s, opens: 15 s, swing: 52.5 deg/s,
                                                leading: kitchen_door}]}
"""
EVERYWHERE = """\
  busy: {behaviours: [doors_open, doors_moving]}
search:
  s:
    scenario: busy
    sut: pilot
    minimise: any
    method: halton
    over:
      floorplan.hinged_width: 0.94 .. 1.0 m
      doors_moving.swing: 48 .. 72 deg/s
      mission.start.y: -0.2 .. 0.2 m
      courier.waypoints.kitchen.x: 0.1 .. 0.4
      courier.laser.noise: 0.01 .. 0.05 m, log
      robot.laser.rays: 100 .. 400
      robot.laser.too_near: [infinite, clamped]
      pilot.max_speed: 0.3 .. 0.8
"""
FAR = (0.97, 52.5, 0.125, 0.3, 0.02, 181.0, "clamped", 0.45)
VARIED = """\
  busy: {behaviours: doors_open, vary: {floorplan: {flat: {slack: 0.1 m}}, samples: 1}}
search:
  s: {scenario: busy, sut: pilot, minimise: keeps-clear, method: halton,
      over: {vary.slack: 0.09 .. 0.14 m}}
"""

DOORS = """\
parameter swing = 60 deg/s
parameter closes = 6 s
parameter opens = 14 s
group leading: bedroom_door

all leading moves to open at 0 s, to closed at closes, to open at opens, by servo at swing
living_room_door toggles between closed and open every 5 s with probability 0.5
"""


@pytest.fixture
def folder(demo):
    """The layers of the demonstration, with doors whose times have names."""
    (demo / "doors_moving.scenery").write_text(DOORS)
    return demo


def write(folder, rest, chance="per repeat"):
    path = folder / "tiny.yaml"
    path.write_text(CAMPAIGN.replace("per repeat", chance) + rest)
    return path


@pytest.fixture
def case(folder):
    """The search for times of doors."""
    return load_search_case(write(folder, TIMES), "s")


def only_run(folder, text):
    """The one run of a campaign, and the campaign."""
    (folder / "s.found.yaml").write_text(text)
    campaign = load_campaign(folder / "s.found.yaml")
    (run,) = expand(campaign).specs
    return run, campaign


@pytest.mark.parametrize("chance", ["per repeat", "per campaign"])
@pytest.mark.parametrize(
    ("point", "number", "scenario"),
    [(OTHER, 7, OTHER_BUSY), (WRITTEN, 0, BUSY.replace("busy", "s.0"))],
    ids=["other", "written"],
)
def test_a_point_is_the_run_with_its_values_beside_the_layer(
    folder, chance, point, number, scenario
):
    case = load_search_case(write(folder, TIMES, chance), "s")
    assert tuple(p.written for p in case.task.parameters) == WRITTEN
    made = [case.candidate(point, number, repeat) for repeat in range(3)]
    runs = expand(load_campaign(write(folder, scenario, chance))).specs
    assert [m.spec.digest for m in made] == [r.digest for r in runs if r.sut.name == "pilot"]
    assert all(one.spec.scene == one.scene.digest for one in made)
    # What comparisons measure is left out.
    assert [oracle.name for oracle in made[0].spec.oracles] == ["keeps-clear", "nearest"]


FOUND = {
    "every layer": (DOORS, EVERYWHERE, FAR),
    "what is not as written": (DOORS, TIMES, (6.25, *WRITTEN[1:])),
    "more digits than a point has": (
        DOORS.replace("= 6 s", "= 6.00000000004 s"), TIMES, (None, 14.0, 61.0, "bedroom_door")),
    "a building of a variation": (DOORS, VARIED, (0.12,)),
}  # fmt: skip


def test_the_campaign_of_a_point_has_its_very_run_which_can_be_taken_apart(folder, golden):
    texts = []
    for name, (doors, campaign, point) in FOUND.items():
        (folder / "doors_moving.scenery").write_text(doors)
        path = write(folder, campaign)
        if "vary" in campaign:
            path.write_text(path.read_text().replace("  floorplan: flat\n", "", 1))
        case = load_search_case(path, "s")
        written = (parameter.written for parameter in case.task.parameters)
        point = tuple(w if p is None else p for p, w in zip(point, written, strict=True))
        spec, taken = case.candidate(point, 5).spec, case.run_case(point, 5)
        text = case.found_text(made_trial(point, -0.1, 5), comment="It fails.", why="late: bad")
        run, found = only_run(folder, text)
        assert (run.digest, found.searches) == (spec.digest, ())
        assert taken.spec == spec
        again = taken.candidate(frozenset(), spec.oracles[0])
        assert again.spec == replace(spec, oracles=spec.oracles[:1])
        texts += [f"--- {name}", text, *(str(element) for element in taken.added)]
    golden("found.txt", "\n".join([*texts, ""]))


def test_a_point_has_the_same_run_however_often_and_after_whatever(case):
    first = case.candidate(WRITTEN, 0).spec.digest
    others = {case.candidate((4.0 + n / 10, 20.0, *WRITTEN[2:]), n).spec.digest for n in range(99)}
    assert len(others) == 99
    with pytest.raises(InputError, match="is not after"):
        case.candidate((15.0, *WRITTEN[1:]), 1)
    assert case.candidate(WRITTEN, 0).spec.digest == first


@pytest.mark.parametrize(
    ("changes", "parameter", "message"),
    [
        ({"scenario": "other"}, {}, 'no scenario "other"'),
        ({"sut": "a2s"}, {}, 'no system under test "a2s"'),
        ({}, {"index": 9}, "no layer 9 in"),
        ({}, {"slot": "vary"}, "no layer 1 in vary"),
    ],
)
def test_a_task_of_another_campaign_is_refused(case, changes, parameter, message):
    first, *rest = case.task.parameters
    parameters = (replace(first, **parameter), *rest)
    with pytest.raises(InputError, match=message):
        search_case(case.campaign, replace(case.task, parameters=parameters, **changes))


RUDE = """\
  rude:
    objects: [doors, people]
    behaviours: [doors_open, doors_in_your_face]
    oracles: [reached, keeps-clear]
search:
  near:
    scenario: rude
    sut: pilot
    minimise: keeps-clear
    over: {doors_in_your_face.near: 0.5 .. 2 m}
"""


@pytest.fixture
def rude(folder):
    """The search for how near doors shut in the robot's face."""
    return load_search_case(write(folder, RUDE), "near")


def runs_judged_by(fails):
    """Runs that are not executed: they fail keeps-clear by a rule about their specification."""

    def result(spec):
        margin = -0.02 if fails(spec) else 0.1
        margins = {o.name: margin if o.name == ORACLE else 0.1 for o in spec.oracles}
        return result_of(spec, margin, margins=margins)

    return LocalRuns(lambda candidates: [result(candidate.spec) for candidate in candidates])


def shrink(case, fails):
    """Shrink the run of a point; return its runs and what is left."""
    points = PointRunner(case, runs := runs_judged_by(fails))
    failure = points.finish(points.begin((1.5,), "explore", "halton", guided=False))
    return runs, shrink_failure(points, failure)


def test_one_door_and_its_behaviour_are_left_of_a_failure(rude, golden):
    def fails(spec):
        doing = any(b.joint.startswith("kitchen_door") for b in spec.behaviours)
        return doing and any(w.id == "kitchen" for w in spec.mission.waypoints)

    runs, shrunk = shrink(rude, fails)
    tried = [p for p in runs.proposals if p.phase == "shrink"]
    assert (shrunk.minimal, shrunk.runs) == (True, len(tried))
    assert len(set(runs.digests)) == len(runs.digests)
    # Each is its own scenario.
    notes = (f"{p.number} {runs.result(p.position).scenario} {p.values} {p.note}" for p in tried)
    golden("shrunk.txt", "\n".join([*shrunk.story, shrunk.left, *notes, ""]))


def test_a_run_that_does_not_fail_is_not_shrunk(rude):
    _, shrunk = shrink(rude, lambda spec: False)
    story = "nothing to shrink: near.0/pilot/0 does not fail keeps-clear: "
    assert shrunk.story == (f"{story}reached pass, keeps-clear pass",)
    assert shrunk.runs == 0


def test_missing_waypoints_are_called_so(rude):
    whole = rude.run_case((1.5,), 0)
    removed = (one for one in whole.remaining(frozenset()) if one.name in ("kitchen", "home"))
    part = whole.candidate(frozenset(removed), whole.spec.oracles[1])
    words = missing_words(Candidate(whole.spec, whole.cell.scene), part)
    assert words == "without waypoint kitchen, waypoint home"


def test_a_whole_search_leaves_a_file_with_the_very_run_it_found(folder, rude):
    def fails(spec):
        return any(b.distance > 1.2 for b in spec.behaviours if isinstance(b, Trigger))

    task = replace(rude.task, runs=6, method="halton", confirm=2, then=("nearest", "shrink"))
    runs = runs_judged_by(fails)
    answer = run_search(replace(rude, task=task), runs)
    run, _ = only_run(folder, answer.found)
    assert run.digest == answer.reported_failure.digest
    assert run.digest == runs.digests[answer.nearest.result.proposal.position]
    assert run.label == answer.reported_failure.label
    phases = list(dict.fromkeys(p.phase for p in runs.proposals))
    assert phases == ["explore", "confirm", "nearest", "shrink"]


SEARCHED = f"""\
{CAMPAIGN}  busy: {{behaviours: doors_moving}}
search:
  s:
    scenario: busy
    sut: pilot
    minimise: keeps-clear
    method: halton
"""
LATE = """\
  late:
    scenario: busy
    sut: pilot
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
LEADING = """\
    over: {doors_moving.closes: 4 .. 10 s, doors_moving.leading: [kitchen_door, bedroom_door]}
"""
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
    "a boundary over three parameters": (SWINGS, {"method": "boundary"}),
    "a boundary over a list": (LEADING, {"method": "boundary"}),
    "a distribution over a list": (LEADING, {"method": "cma"}),
    "a distribution over one parameter": (
        "    over: {doors_moving.closes: 4 .. 10 s}\n",
        {"method": "cma"},
    ),
}


@pytest.fixture
def file(folder):
    """A campaign of a sound search."""
    path = folder / "tiny.yaml"
    path.write_text(SEARCHED + SOUND)
    return path


def findings(file, rest, changes):
    """Write a search; return what a check says of its task with these changes."""
    file.write_text(SEARCHED + rest)
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
    file.write_text(SEARCHED + UNSOUND)
    title, found = check_file(file)
    assert title == "1 scenario, 6 runs, 1 search"
    assert [one.message for one in found if "makes no run" in one.message]


def test_a_search_is_known_by_its_files_and_values_wherever_they_are(file, tmp_path):
    submission, _, warnings = prepare_search(file)
    assert (warnings, submission.name) == ((), "tiny-s")
    assert submission.campaign.startswith("tiny-s-")
    assert prepare_search(file, "s")[0] == submission
    moved = shutil.copytree(file.parent, tmp_path / "moved")
    assert prepare_search(moved / file.name)[0].campaign == submission.campaign
    with (moved / "courier.mission.yaml").open("a") as mission:
        mission.write("# another one\n")
    others = [
        prepare_search(moved / file.name),
        prepare_search(file, change=lambda task: replace(task, seed=8)),
        prepare_search(file, change=lambda task: replace(task, runs=61)),
        prepare_search(file, fresh=True),
        prepare_search(file, fresh=True),
    ]
    assert len({submission.campaign, *(other[0].campaign for other in others)}) == 6


@pytest.mark.parametrize(
    ("text", "name", "message"),
    [
        (SEARCHED + SOUND + LATE, "", r"several searches\n.*s, late"),
        (SEARCHED + SOUND + LATE, "lat", r'no search "lat"\n.*late'),
        (SEARCHED[: SEARCHED.index("search:")], "", "has no searches"),
        ((SEARCHED + SOUND).replace("minimise: keeps-clear", "minimise: nothing"), "", "nothing"),
    ],
)
def test_no_search_is_guessed_nor_handed_over_with_an_error(file, text, name, message):
    file.write_text(text)
    with pytest.raises(InputError, match=message):
        prepare_search(file, name)


def test_a_search_of_several_is_found_by_its_name_and_a_changed_one_is_checked(file):
    file.write_text(SEARCHED + SOUND + LATE)
    assert prepare_search(file, "late")[0].task.name == "late"
    with pytest.raises(InputError, match="nonsense"):
        prepare_search(file, "late", change=lambda task: replace(task, method="nonsense"))


def test_a_known_search_goes_on_by_its_id_as_it_was_begun(file):
    begun = prepare_search(file, change=lambda task: replace(task, seed=8)).submission
    row = SearchRow(begun.campaign, begun.name, 0.0, begun.task, "waiting")
    again = prepare_search(file, begun.campaign, find={row.campaign: row}.get)
    assert again.submission == begun
