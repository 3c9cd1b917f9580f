"""Texts that would steer a terminal, put wherever a daemon, a trace or a file has a text.

What is left of them is looked for in the bytes a terminal got.
"""

import dataclasses
import re
import unicodedata
from collections.abc import Mapping
from dataclasses import dataclass, replace
from enum import Enum

import numpy as np
from mcap.writer import Writer

from daemon.model.spec import OracleText
from daemon.model.sut import Estimate, Progress
from daemon.trace import TraceWriter
from grammars.model.geometry import Pose2, Twist2
from grammars.model.scene import Scene
from tests.people.fake import FakeDaemon, make_row, make_spec
from tests.people.recorded import ORACLES, WORLD

WORD = "POISON"
POISON = (
    # A title for the window, everything cleared, a hidden text, a colour by a C1 control.
    f"\x1b]0;{WORD}\x07\x1b[2J\x1b[8m{WORD}\x9b31m"
    # Turned around, isolated, a line of its own, tags, and a line written over.
    f"\u202e\u2066\u200f\u2028\U000e0041\ufeff\x7f{WORD}\r"
)
NAME = POISON.replace("\r", "")
"""For places that end at the end of a line."""
_MEANT = frozenset(
    {"digest", "engine", "kind", "map", "phase", "robot", "scene", "slot", "state", "trace"}
)
"""Fields with a meaning to the program: other texts there are refused before they are shown."""

# What we send: styles, the cursor moved, hidden and shown, lines erased, modes of the keyboard and
# mouse set and asked for, the shape of its pointer; the background asked for. The poison is none
# of these.
_OURS = re.compile(r"\x1b\[[?<>=]?[0-9;]*\$?[A-DHKchlmnpu]|\x1b\]22;\w+\x07|\x1b\]11;\?\x1b\\|\r")
_KEPT = "\n\t\u200c\u200d\u00ad"


def poisoned(value):
    """Return a value with poison behind every text in it that is not empty."""
    return _changed(value, lambda text: f"{text}{NAME}" if text else text)


def _cured(value):
    """Return a request that names what was poisoned by its own name."""
    return _changed(value, lambda text: text.replace(NAME, ""))


def _changed(value, change):
    """Return a value with every text in it changed that the program does not interpret."""
    if isinstance(value, str) and not isinstance(value, Enum):
        return change(value)
    if isinstance(value, tuple):
        return tuple(_changed(one, change) for one in value)
    if isinstance(value, Mapping):
        return {key: _changed(one, change) for key, one in value.items()}
    if dataclasses.is_dataclass(value) and not isinstance(value, type):
        names = {field.name for field in dataclasses.fields(value) if field.init} - _MEANT
        # Joints and links of a scene are found by their names.
        names &= {"name", "regions", "doorways"} if isinstance(value, Scene) else names
        changes = {name: _changed(getattr(value, name), change) for name in names}
        return dataclasses.replace(value, **changes)
    return value


@dataclass
class PoisonedDaemon(FakeDaemon):
    """A daemon whose every answer is poisoned; it understands what it is asked about those."""

    def ask(self, verb, request):
        """Answer as the daemon it is made of, poisoned."""
        return poisoned(super().ask(verb, _cured(request)))

    def scene(self, digest):
        """Return a scene that is poisoned although its digest is right."""
        return poisoned(super().scene(digest))


def assert_harmless(raw):
    """Check that nothing a terminal got steers it, save what is ours; return the text."""
    text = raw.decode()
    assert "\x1b[8m" not in text, "a text of others has a style"
    assert "\x1b[2J" not in text, "a text of others clears the screen"
    shown = _OURS.sub("", text)
    steering = {
        sign
        for sign in shown
        if unicodedata.category(sign) in ("Cc", "Cf", "Cs", "Zl", "Zp") and sign not in _KEPT
    }
    where = next((i for i, sign in enumerate(shown) if sign in steering), 0)
    assert not steering, f"{steering!r} in {shown[max(0, where - 200) : where + 60]!r}"
    return shown


def yaml_text(text):
    """Return a text as YAML has it in a file that holds none of its signs."""
    return '"' + "".join(f"\\U{ord(sign):08x}" for sign in text) + '"'


def record_poisoned(path):
    """Record a second of a run all of whose texts are poisoned: a trace that can be read."""
    run = poisoned(replace(make_spec(make_row(5), WORLD.digest), oracles=()))
    oracles = (OracleText(f"calm{NAME}", "max(speed) <= 0.1 m/s"), *ORACLES)
    world = poisoned(WORLD)
    run = replace(run, oracles=oracles, scene=world.digest, limit=20.0, behaviours=())
    path.parent.mkdir(parents=True, exist_ok=True)
    with TraceWriter(path, run, world) as trace:
        for step in range(21):
            now = step * 0.05
            trace.ground_truth(now, Pose2(1.0 + 0.5 * now, 2.0), Twist2(0.5, 0.0, 0.0))
            trace.joints(now, np.array([-0.1 * now]), np.array([-0.1]))
            trace.estimate(Estimate(now, Pose2(1.2 + 0.5 * now, 2.0), np.eye(3)))
        trace.event(0.5, f"planner{NAME}", f"no path{POISON}", level="warn")
        trace.contact(0.7, "robot", f"door-1/leaf{NAME}", (1.35, 2.0), (1.0, 0.0), 0.01)
        trace.progress(0.8, Progress(0, 0, "active"))
        trace.attach(f"stack{NAME}.txt", f"printed{POISON}\n".encode() * 3)
        trace.close("finished", f"note{NAME}")
    return path


def write_foreign_trace(path):
    """Write an MCAP file of somebody else, poisoned wherever MCAP has a text."""
    with path.open("wb") as file:
        writer = Writer(file)
        writer.start(profile=NAME, library=NAME)
        schema = writer.register_schema(NAME, "jsonschema", POISON.encode())
        channel = writer.register_channel(f"/events{NAME}", NAME, schema, {NAME: POISON})
        writer.add_message(channel, 0, POISON.encode(), 0)
        writer.add_metadata(f"run{NAME}", {"spec": POISON, NAME: POISON})
        writer.add_metadata("run", {"spec": POISON, NAME: POISON})
        writer.add_attachment(0, 0, f"spec{NAME}", "application/json", POISON.encode())
        writer.finish()
    return path
