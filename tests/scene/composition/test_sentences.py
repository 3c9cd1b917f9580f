"""Sentences and the behaviours they become, objects and where they stand, as a text.

``sentences.txt`` has cases whose lines begin with ``---``, each followed by the behaviours that its
sentences become, one a line; in its last part, by the objects that its sentences place.
"""

import json
import re
from pathlib import Path

from grammars.model.behaviour import Behaviour
from grammars.scenery.composition import compile_scene
from grammars.text import codec
from tests.languages.plans import behaviours_of, layer, two_rooms

BLOCK = re.compile(
    r"^=== (?P<kind>\w+).*\n(?P<objects>(?:.+\n)*)"
    r"|^(?P<case>(?:--- .*\n)+)(?:(?!---|===).+\n)*",
    re.MULTILINE,
)


def line(plain):
    """Return a value as JSON with 9 decimals."""
    rounded = json.loads(json.dumps(plain), parse_float=lambda text: round(float(text), 9) + 0.0)
    return json.dumps(rounded) + "\n"


def placed(sentences):
    for thing in compile_scene(two_rooms(), [layer(sentences)]).objects:
        limits = {joint.name: [joint.lower, joint.upper] for joint in thing.joints}
        pose = (thing.pose.x, thing.pose.y, thing.pose.yaw)
        marks = [mark for mark in ("mirrored", "frozen") if getattr(thing, mark)]
        yield line([thing.name, pose, thing.doorway, thing.initial, limits, *marks])


def told(objects, sentences):
    for behaviour in behaviours_of(objects, sentences):
        plain = codec.to_plain(behaviour, Behaviour)
        assert codec.from_plain(Behaviour, plain) == behaviour
        yield line(plain)


def renewed(text):
    kind = objects = ""

    def renew(block):
        nonlocal kind, objects
        if block["kind"]:
            kind, objects = block["kind"], block["objects"]
            return block[0]
        sentences = re.sub("^--- ", "", block["case"], flags=re.MULTILINE)
        results = placed(sentences) if kind == "objects" else told(objects, sentences)
        return block["case"] + "".join(results)

    return BLOCK.sub(renew, text)


def test_sentences(golden):
    golden("sentences.txt", renewed(Path(__file__).with_name("sentences.txt").read_text("utf-8")))
