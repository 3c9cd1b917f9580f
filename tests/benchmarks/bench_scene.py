"""From text to a checked Scene: building C with its seventeen doors, warm."""

from __future__ import annotations

import time
from collections.abc import Callable
from pathlib import Path
from typing import TypeVar

from grammars.floorplan import load_floorplan
from grammars.jsonld import check_composition
from grammars.preflight import check_scene
from grammars.scenery import load_scenery
from grammars.scenery.composition import compile_scene

T = TypeVar("T")
FOLDER = Path(__file__).parents[2] / "campaigns" / "ortega2024"


def main() -> None:
    best: dict[str, float] = {}

    def timed(step: str, make: Callable[[], T]) -> T:
        start = time.thread_time()
        made = make()
        best[step] = min(best.get(step, 1e9), time.thread_time() - start)
        return made

    for _ in range(5):
        plan = timed("plan from text", lambda: load_floorplan(FOLDER / "building_c.fpm"))
        doors = timed("doors from text", lambda: load_scenery(FOLDER / "doors.scenery"))
        scene = timed("scene compiled", lambda: compile_scene(plan, [doors]))  # noqa: B023
        timed("world checked", lambda: check_scene(scene))  # noqa: B023
        timed("composition checked", lambda: check_composition(plan, [doors]))  # noqa: B023
    for step, seconds in best.items():
        print(f"{step:24} {1e3 * seconds:7.1f} ms")
    print(f"{'text to checked scene':24} {1e3 * sum(best.values()):7.1f} ms")


if __name__ == "__main__":
    main()
