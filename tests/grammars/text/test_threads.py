"""Languages are loaded by whichever thread comes first, also by several at once."""

from __future__ import annotations

from concurrent.futures import ThreadPoolExecutor
from threading import Barrier

from grammars.floorplan import _syntax as floorplan
from grammars.oracle import _parse as oracle
from grammars.scenery import _syntax as scenery
from grammars.variation import _syntax as variation

LANGUAGES = (floorplan, oracle, scenery, variation)


def test_languages_are_loaded_by_several_threads_at_once() -> None:
    together = Barrier(len(LANGUAGES))

    def load(language: object) -> str:
        together.wait(60.0)
        return str(language._metamodel.__wrapped__().rootcls.__name__)  # type: ignore[attr-defined]

    with ThreadPoolExecutor(len(LANGUAGES)) as threads:
        names = list(threads.map(load, LANGUAGES))
    assert len(set(names)) == len(LANGUAGES)
