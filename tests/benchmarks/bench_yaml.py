"""Reading YAML with the place of every value: libyaml's events beside PyYAML's own parser.

One long file and every file of the campaigns.
"""

import yaml

from grammars.text.documents import parse_yaml
from tests.benchmarks.measurement import side_by_side
from tests.parts import ROOT

KEYS = 10_000


def measure():
    """Yield the time for one long file and for the files that ship."""
    shipped = [path.read_text("utf-8") for path in sorted((ROOT / "campaigns").rglob("*.yaml"))]
    long = ["".join(f"key_{i}: {i}.5 m\n" for i in range(KEYS))]
    for what, texts in ((f"{KEYS} keys", long), (f"{len(shipped)} files of campaigns", shipped)):
        works = {
            "PyYAML's own parser": lambda t=texts: [yaml.load(x, yaml.SafeLoader) for x in t],
            what: lambda t=texts: [parse_yaml(text, "bench.yaml") for text in t],
        }
        yield from side_by_side(works, 1)
