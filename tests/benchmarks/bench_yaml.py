"""Reading YAML with the place of every value: libyaml's events beside what PyYAML makes of them.

One long file and every file of the campaigns.
"""

import time
from pathlib import Path

import yaml

from grammars.text.documents import parse_yaml
from tests.benchmarks.measurement import Measurement, Reference

KEYS = 10_000
CAMPAIGNS = Path(__file__).parents[2] / "campaigns"


def ours(text):
    parse_yaml(text, "bench.yaml")


def own_parser(text):
    yaml.load(text, Loader=yaml.SafeLoader)


def measure():
    """Yield the time for one long file and for the files that ship."""
    shipped = [path.read_text("utf-8") for path in sorted(CAMPAIGNS.rglob("*.yaml"))]
    texts = {
        f"{KEYS} keys": ["".join(f"key_{i}: {i}.5 m\n" for i in range(KEYS))],
        f"{len(shipped)} files of the campaigns": shipped,
    }
    ours("a: 1")
    for what, given in texts.items():
        took = {}
        for read in (own_parser, ours):
            start = time.perf_counter()
            for text in given:
                read(text)
            took[read] = time.perf_counter() - start
        beside = Reference("PyYAML's own parser", took[own_parser])
        yield Measurement(what, took[ours], "s", beside)
