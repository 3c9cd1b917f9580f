"""Languages are loaded by whichever thread comes first, also by several at once."""

from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from threading import Barrier

import grammars
from grammars.text.parsing import load_metamodel

GRAMMARS = sorted(Path(grammars.__path__[0]).glob("*/*.tx"))


def test_languages_are_loaded_by_several_threads_at_once():
    assert len(GRAMMARS) == 5
    together = Barrier(len(GRAMMARS))

    def load(grammar):
        together.wait(60.0)
        return str(load_metamodel(grammar).rootcls.__name__)

    with ThreadPoolExecutor(len(GRAMMARS)) as threads:
        names = list(threads.map(load, GRAMMARS))
    assert len(set(names)) == len(GRAMMARS)
