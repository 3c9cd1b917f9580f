"""When an app has nothing left to do: no message, no layout, no worker, no timer about to fire.

Textual takes a process for idle that uses no CPU time for a while, and a loaded machine does not
let one run for longer than that. What it asks its machine, these functions ask the app.
"""

import asyncio
import time

from textual._context import active_app
from textual.message_pump import MessagePump

from tests.parts import DEADLINE

_QUIET = 5
"""Turns of the loop without anything to do after which there will be nothing."""
_BUSY = 10
"""Turns of the loop that others have work in, after which the app is looked at all the same."""
_SOON = 0.3
"""Seconds within which what was put off by a timer is waited for: resizing, checks of files."""
_THREADS = 0.002
"""Seconds between two looks at what is done by others than this thread."""


async def until_idle(app, in_threads=bool):
    """Wait until an app has taken in all it was sent, and shows it; or until it is being left.

    ``in_threads`` says whether threads of the app still do something that they will tell it.
    """
    deadline, quiet, busy = time.monotonic() + DEADLINE, 0, 0
    # What was sent from outside of the app's own tasks is in its queue after a turn.
    await asyncio.sleep(0)
    while quiet < _QUIET and app.is_running and not app._exit and app._exception is None:
        # To ask every widget takes as long as most of what they do. While there is work in this
        # turn it is too early; and where nobody had any since they were asked, they say the same.
        works = bool(asyncio.get_running_loop()._ready)
        busy = busy + 1 if works else 0
        doing = None if quiet or busy % _BUSY else next(_under_way(app, in_threads), None)
        quiet = 0 if works or doing is not None else quiet + 1
        assert time.monotonic() < deadline, f"still under way: {doing!r}"
        # A message is a matter of turns of this loop; what others do needs the processor.
        await asyncio.sleep(0 if doing is None or isinstance(doing, MessagePump) else _THREADS)


async def wait_for_idle(min_sleep=0.0, max_sleep=1.0):
    """Do what textual's function of this name is for, without looking at any clock."""
    await until_idle(active_app.get())


def _under_way(app, in_threads):
    """Yield what is not done yet; has the screens lay out what they were about to."""
    if in_threads():  # before all that they may have told meanwhile
        yield in_threads
    for screen in app.screen_stack:
        if _to_lay_out(screen):
            # Else a timer does that, sixty times a second.
            screen._on_timer_update()
    yield from (pump for pump in (app, *app._registry) if not _waits_for_messages(pump))
    yield from (screen for screen in app.screen_stack if _to_lay_out(screen))
    yield from (worker for worker in app.workers if not worker.is_finished)
    yield from (timer for pump in (app, *app._registry) for timer in _about_to_fire(pump))


def _to_lay_out(screen):
    """Whether something is to be laid out, or called when that was done.

    What is only to be painted is not asked for: nobody reads the screen as it was painted last.
    """
    pending = screen._layout_required or screen._scroll_required or screen._recompose_required
    return bool(screen._callbacks or (pending and screen.is_current))


def _waits_for_messages(pump):
    """Whether a part of the app stands where it gets its next message, and there is none."""
    if pump._closed:
        return True
    queue = pump._message_queue
    waiting = any(not waiter.done() for waiter in queue.ready_event._waiters)
    return waiting and queue.empty()


def _about_to_fire(pump):
    """Yield timers that fire once, and soon; what repeats is never over."""
    for timer in list(pump._timers):
        runs = timer._task is not None and not timer._task.done()
        if runs and timer._repeat == 0 and timer._interval <= _SOON:
            yield timer
