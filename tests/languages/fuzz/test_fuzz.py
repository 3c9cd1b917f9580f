"""A short round of the fuzz, the same each time, and all that longer rounds have found."""

import random

import pytest
from hypothesis import settings

from tests.languages.fuzz.mutation import mutated
from tests.languages.fuzz.targets import CORPUS, TARGETS, answer, prepare

TIMES = {"launch": 4, "map": 4, "image": 4, "parameters": 2, "sut": 2, "varied": 1, "walls": 1}
TIMES |= dict.fromkeys(("plan-graph", "object-graph", "earlier-plan", "earlier-numbers"), 0.25)
TIMES |= {"variants": 0.2, "varied-plan": 0.2}
"""Inputs for each example of a property: a campaign takes some hundredths of a second, 0.4."""


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    return prepare(tmp_path_factory.mktemp("fuzz"))


@pytest.mark.parametrize("target", TARGETS, ids=lambda target: target.name)
def test_mutated_files_are_taken_or_refused_with_a_place(folder, target):
    sound = (folder / target.file).read_bytes()
    assert answer(target, folder, sound)
    for index in range(int(settings().max_examples * TIMES.get(target.name, 0.4))):
        rng = random.Random(f"short {target.name} {index}")
        answer(target, folder, mutated(rng, [sound], rng.choice((1, 2, 4))))
    for found in sorted((CORPUS / target.name).glob("*")):
        answer(target, folder, found.read_bytes())
