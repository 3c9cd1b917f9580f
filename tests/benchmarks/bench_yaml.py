"""Reading YAML with the place of every value: libyaml's events beside those of ruamel.yaml.

One long file and every file of the campaigns.
"""

import time
from pathlib import Path

from ruamel.yaml import YAML

from grammars.text.documents import parse_yaml
from tests.benchmarks.measurement import Measurement, Reference

KEYS = 10_000
CAMPAIGNS = Path(__file__).parents[2] / "campaigns"


def ours(text):
    parse_yaml(text, "bench.yaml")


def round_trip(text):
    yaml = YAML(typ="rt")
    yaml.version = (1, 2)
    yaml.load(text)


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
        for read in (round_trip, ours):
            start = time.perf_counter()
            for text in given:
                read(text)
            took[read] = time.perf_counter() - start
        beside = Reference("ruamel.yaml's round trip", took[round_trip])
        yield Measurement(what, took[ours], "s", beside)
