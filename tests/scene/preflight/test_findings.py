"""Findings about scenes and runs in the two rooms of :mod:`tests.languages.plans`, as texts.

Each text file has scenes and cases::

    === a title, and the objects of a scene up to an empty line
    plan: width=1 m => width=0.4 m      (other words in the floor plan)
    way: (0, 0, 0) to (3, 0), (4, 0)    (start and waypoints; without, the scene alone is checked)

    --- a sentence about the objects, or "+ " and another object, or a way, or "words => others"
    the findings, with their hints; a ? stands in front of warnings
"""

import ast
import functools
import re
from dataclasses import replace
from pathlib import Path

import pytest

from grammars.model.behaviour import Walk
from grammars.model.geometry import Pose2
from grammars.preflight import check_run, check_scene
from grammars.scenery.composition import compile_scene
from grammars.text.diagnostics import Where
from tests.languages.plans import layer, resolved, two_rooms
from tests.scene.preflight.samples import ROBILE, mission, shown

HERE = Path(__file__).parent
BLOCK = re.compile(
    r"^=== .*\n(?P<scene>(?:.+\n)+)|^(?P<case>(?:---(?: .*)?\n)+)(?:(?!---|===).+\n)*", re.MULTILINE
)


@functools.cache
def composed(plan, objects):
    objects = layer(objects)
    return objects, compile_scene(two_rooms(*plan), [objects])


def findings_of(scene, case):
    *_, way = ["", *(line[5:] for line in (*scene, *case) if line.startswith("way: "))]
    changes = [tuple(line.split(" => ")) for line in (*scene, *case) if " => " in line]
    plan = tuple((old[6:], new) for old, new in changes if old.startswith("plan: "))
    objects = [line for line in scene if not line.startswith(("plan: ", "way: "))]
    text = "\n".join([*objects, *(line[2:] for line in case if line.startswith("+ "))])
    for old, new in changes:
        if not old.startswith("plan: "):
            assert old in text
            text = text.replace(old, new)
    said = [line for line in case if not re.match(r"\+ |way: |$", line) and " => " not in line]
    objects, compiled = composed(plan, text)
    if not way:
        return check_scene(compiled)
    sentences = layer("\n".join(said), "sentences", models=False)
    behaviours = resolved(compiled, [objects, sentences]).behaviours
    begins = {walk.object: walk.route[0] for walk in behaviours if isinstance(walk, Walk)}
    # Movers stand where their walks begin: nothing else here is about that.
    placed = [
        replace(body, pose=Pose2(*begins[body.name], body.pose.yaw))
        if body.name in begins
        else body
        for body in compiled.objects
    ]
    compiled = replace(compiled, objects=tuple(placed))
    start, _, points = way.partition(" to ")
    task = mission(*ast.literal_eval(f"[{points}]"), start=Pose2(*ast.literal_eval(start)))
    return check_run(compiled, ROBILE, task, behaviours, where=Where("task.yaml"))


def renewed(text):
    scene = []

    def renew(block):
        nonlocal scene
        if block["scene"]:
            scene = block["scene"].splitlines()
            return block[0]
        case = [line[4:] for line in block["case"].splitlines()]
        found = shown(findings_of(scene, case)) or ["nothing"]
        return block["case"] + "".join(f"{one}\n" for one in found)

    return BLOCK.sub(renew, text)


@pytest.mark.parametrize("name", ["routes", "ways", "doors", "waiting"])
def test_findings(name, golden):
    golden(f"{name}.txt", renewed((HERE / f"{name}.txt").read_text("utf-8")))
