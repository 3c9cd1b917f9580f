"""Examples below the help of each command: lines to copy. The tests execute every one of them.

The tests run them in a folder with a campaign file ``campaign.yaml``, submitted as ``nightly``, a
floor plan ``flat.fpm``, and the output of earlier lines.
"""

from __future__ import annotations

from typing import Final

EXAMPLES: Final[dict[str, tuple[str, ...]]] = {
    "demo": ("scenario demo",),
    "new": (
        "scenario new my-tests",
        "scenario new my-office --floorplan flat.fpm",
        "scenario new --layers",
    ),
    "check": ("scenario check campaign.yaml", "scenario check flat.fpm doors.scenery"),
    "run": (
        "scenario run campaign.yaml",
        "scenario run campaign.yaml --out results --junit results.xml",
    ),
    "submit": ("scenario submit campaign.yaml", "scenario submit campaign.yaml --fresh --watch"),
    "search": (
        "scenario search campaign.yaml doors-in-time --budget 4 --detach",
        "scenario search",
    ),
    "wait": ("scenario wait nightly --timeout 10min",),
    "serve": ("scenario serve campaign.yaml --scenario open-house --headless",),
    "sut show": ("scenario sut show pilot", "scenario sut show pilot --json"),
    "sut check": ("scenario sut check my_stack.yaml",),
    "sut relay": ("scenario sut relay > relay.py",),
    "tui": ("scenario tui", "scenario tui --read-only", "scenario tui --bindings"),
    "status": ("scenario status", "scenario status --json"),
    "results": (
        "scenario results",
        "scenario results nightly --runs",
        "scenario results nightly --outcome fail --json",
        "scenario results nightly --table nightly.parquet",
    ),
    "show": ("scenario show nightly.0", "scenario show nightly.0 --log"),
    "replay": ("scenario replay nightly.0", "scenario replay nightly.0 --frame 5"),
    "plot": ("scenario plot nightly.0 clearance speed",),
    "judge": ("scenario judge nightly.0", "scenario judge nightly.0 --json"),
    "verify": ("scenario verify nightly.0",),
    "compare": ("scenario compare nightly nightly",),
    "report": (
        "scenario report nightly",
        "scenario report nightly -o nightly.html --junit nightly.xml",
    ),
    "coverage": ("scenario coverage nightly", "scenario coverage campaign.yaml"),
    "blame": ("scenario blame nightly.1 --runs 10",),
    "cancel": ("scenario cancel nightly",),
    "retry": ("scenario retry nightly", 'scenario retry nightly --only "fail|error"'),
    "acknowledge": ("scenario acknowledge nightly",),
    "pause": ("scenario pause nightly", "scenario pause nightly --off"),
    "priority": ("scenario priority nightly 5", "scenario priority nightly -- -5"),
    "delete": ("scenario delete nightly --dry-run",),
    "daemon": (
        "scenario daemon",
        "scenario daemon --listen tls/0.0.0.0:7447 --slots 0",
        "scenario daemon --print-unit",
        "scenario daemon --stop",
    ),
    "worker": (
        "scenario worker --connect tls/build.example:7447 -j 8",
        "scenario worker --connect tls/build.example:7447 --print-unit",
    ),
    "keys init": ("scenario keys init my-keys --host build.example",),
    "keys issue": ("scenario keys issue viewer wall-screen --keys my-keys",),
    "keys list": ("scenario keys list --keys my-keys",),
    "keys bundle": ("scenario keys bundle worker -o worker.tar --keys my-keys",),
    "keys revoke": ("scenario keys revoke viewer.wall-screen --keys my-keys",),
    "doctor": ("scenario doctor --quick", "scenario doctor --quick --json"),
    "gc": ("scenario gc --dry-run", "scenario gc --older-than 30d --max-size 20GiB --dry-run"),
    "import": ("scenario import map.yaml -o home", "scenario import map.yaml -o home --force"),
    "export": (
        "scenario export flat.fpm jsonld picture",
        "scenario export campaign.yaml map sdf -o artefacts",
        "scenario export nightly.0 picture --from 2 --until 6 -o part.svg",
        "scenario export nightly traces -o traces",
    ),
    "vary": ("scenario vary flat.variation -n 3 --seed 7 -o variants",),
    "schema": (
        "scenario schema campaign",
        "scenario schema --outputs",
        "scenario schema --vscode .",
    ),
}
"""Examples by the words of the command."""
