"""A short round of the fuzz, the same each time, and all that longer rounds have found."""

import random

import pytest

from tests.languages.fuzz.mutation import mutated
from tests.languages.fuzz.targets import CORPUS, TARGETS, answer, prepare

NUMBER = 15
"""Inputs of each language: a campaign takes some hundredths of a second."""
CHEAP = {"variants": 30, "varied-plan": 30, "map": 100, "image": 100, "launch": 200}
CHEAP |= {"scenery": 60, "sut": 60, "parameters": 60}


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    return prepare(tmp_path_factory.mktemp("fuzz"))


@pytest.mark.parametrize("target", TARGETS, ids=lambda target: target.name)
def test_mutated_files_are_taken_or_refused_with_a_place(folder, target):
    sound = (folder / target.file).read_bytes()
    assert answer(target, folder, sound)
    for index in range(CHEAP.get(target.name, NUMBER)):
        rng = random.Random(f"short {target.name} {index}")
        answer(target, folder, mutated(rng, [sound], rng.choice((1, 2, 4))))
    for found in sorted((CORPUS / target.name).glob("*")):
        answer(target, folder, found.read_bytes())
