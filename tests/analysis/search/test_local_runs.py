"""A search on real runs of the demonstration's flat, executed here."""

import shutil

from daemon.search.program import run_search
from tests.analysis.search.cases import load_search_case
from tests.analysis.search.local_runs import LocalRuns

CAMPAIGN = """\
campaign: tiny
seed: 3
limit: 6 s
robot: courier
oracles: navigation
matrix: {sut: [pilot]}
scenarios:
  rude:
    floorplan: flat
    objects: doors
    behaviours: [doors_open, doors_in_your_face]
    mission: courier
    oracles: [keeps-clear]
search:
  near:
    scenario: rude
    minimise: keeps-clear
    over: {doors_in_your_face.near: 0.5 .. 2 m}
    budget: 3 runs
    method: halton
    confirm: 1 repeat
    then: nearest
"""


def test_a_search_of_real_runs_gives_the_same_answer_from_their_results(tmp_path, campaigns):
    for name in ("demo", "robots", "suts"):
        shutil.copytree(campaigns / name, tmp_path / name)
    file = tmp_path / "demo" / "tiny.yaml"
    file.write_text(CAMPAIGN)
    runs = LocalRuns()
    answer = run_search(load_search_case(file, "near"), runs)
    assert answer.ended == "budget"
    assert (answer.explored, answer.errors, answer.inconclusive) == (3, 0, 0)
    assert answer.best is not None
    assert answer.best.value is not None
    assert answer.best.value.object
    assert answer.best.value.waypoint
    again = LocalRuns(slots=3, results=runs.results)
    repeated = run_search(load_search_case(file, "near"), again)
    assert again.digests == runs.digests
    assert repeated.sentences == answer.sentences
    assert (repeated.executed, repeated.reused) == (0, answer.executed)
