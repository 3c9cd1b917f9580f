"""Ways through a dashboard: its steps, and a text that says what each of them changed."""

import inspect
from dataclasses import dataclass, field

from textual.events import Key
from textual.keys import key_to_character

from scenario_tui.dashboard.config import Config
from scenario_tui.dashboard.widgets.tables import KeyedTable, VerdictList
from tests.people.fake import FakeDaemon

LOOK = ""
"""A first step: all that the screen shows, where no other way leads to it."""

_VERBS = {"steer", "cancel", "retry", "delete", "submit", "acknowledge"}
"""What changes something in a daemon."""


@dataclass
class Journey:
    """What is done in the dashboard of ``daemon``, or in an app, that is made anew: its steps.

    A step is a text or an action. The text names keys, which are pressed one after the other; with
    a ``!`` in front all are there before the first one is dealt with. An action is a pair of its
    name and a function of the dash. ``run`` is opened first.
    """

    steps: list
    daemon: object = FakeDaemon
    size: tuple = (80, 24)
    run: str = ""
    config: Config = field(default_factory=Config)


def has(**values):
    """An action: the daemon has other values from now on, each given or made of the dash."""

    def change(dash):
        for name, value in values.items():
            setattr(dash.fake, name, value(dash) if callable(value) else value)

    return ", ".join(values), change


def resized(columns, rows):
    """An action: the terminal has another size."""
    return f"{columns} x {rows}", lambda dash: dash.resize(columns, rows)


def clicked(word):
    """An action: somebody clicks on a word."""

    def click(dash):
        row = next(row for row, line in enumerate(dash.lines) if word in line)
        return dash.pilot.click(offset=(dash.lines[row].index(word) + 1, row))

    return f"a click on {word}", click


def opened(*place):
    """An action: a screen is opened by its name."""
    return " ".join(place), lambda dash: dash.open(*place)


async def follow(dash, steps):
    """Take the steps; return what there is first, and what each of them changed.

    Told are the screen, what has the keys, the row of the table under the cursor and which keys are
    grey; the lines of the screen that changed; what was said, copied and asked of the daemon.
    """
    texts, facts, screens = [], {}, {}
    calls = dash.fake.calls if dash.fake else []
    for step in (None, *steps):
        if step == LOOK:
            texts += [f"{row:3} {line}" for row, line in enumerate(dash.lines) if line]
            continue
        calls.clear()
        said = dash.notices
        if isinstance(step, str):
            name = step
            await _press(dash, step)
        else:
            name, act = step or ("at first", lambda _: None)
            done = act(dash)
            if inspect.isawaitable(done):
                await done
            await dash.settle()
        texts.append(f"--- {name}")
        texts += [f"{fact}: {now}" for fact, now in _changes(facts, _facts(dash))]
        seen = screens.setdefault(dash.screen, {})
        lines = _changes(seen, dict(enumerate(dash.lines)))
        if step:
            texts += [f"{row:3} {line}".rstrip() for row, line in lines]
        texts += [f"said: {line}" for line in dash.notices[len(said) :].split("\n") if line]
        texts += [f"asked: {call}" for call in calls if call[0] in _VERBS]
    return "\n".join([*texts, ""])


def _changes(before, now):
    """Return what is another now, and take it for what was before; at first there was nothing."""
    changed = [(key, text) for key, text in now.items() if before.get(key, "") != text]
    before.update(now)
    return changed


async def _press(dash, step):
    if step.startswith("!"):
        for key in step[1:].split():
            dash.app.post_message(Key(key, key_to_character(key)))
        await dash.settle()
    else:
        await dash.press(*step.split())


def _facts(dash):
    """What is told of a dashboard beside its screen."""
    screen, fake = dash.screen, dash.fake
    bound = [one for one in screen.active_bindings.values() if one.binding.show]
    tables = screen.query(KeyedTable)
    chosen = (one.chosen().oracle for one in screen.query(VerdictList) if one.chosen())
    watched = [*fake.watchers, *(f"{run} judged" for run in fake.judges)] if fake else []
    return {
        "place": f"{type(screen).__name__}, {type(dash.app.focused).__name__}",
        "cursor": ", ".join([*(one.key for one in tables), *chosen]),
        "grey": ", ".join(one.binding.description for one in bound if not one.enabled),
        "watched": ", ".join(watched),
        "copied": dash.app.clipboard,
    }
