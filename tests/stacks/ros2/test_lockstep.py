"""How long cycles wait, which answers are late, when a stack is given up; see ``lockstep.txt``."""

from itertools import groupby

from daemon.model.sut import SutFailure
from daemon.stacks.ros2.link import CycleAnswer
from daemon.stacks.ros2.lockstep import LockStep
from daemon.stacks.ros2.settings import read_settings

# Each with the lag of its command's stamp.
ANSWERS = {
    "answered": (CycleAnswer(0.002, 1, heard=True, server=True), 0.0),
    "without a stamp": (CycleAnswer(0.002, 1, heard=True, server=True), None),
    "nothing": (CycleAnswer(None, 0, heard=False, server=True), None),
    "feedback": (CycleAnswer(None, 0, heard=True, server=True), None),
    "lagging": (CycleAnswer(None, 1, heard=True, server=True), 0.05),
    "lagging more": (CycleAnswer(None, 1, heard=True, server=True), 0.4),
    "far behind": (CycleAnswer(None, 1, heard=True, server=True), 3.0),
}
CASES = {
    "no answer yet": ([], {}),
    "the latency of an answer that was due": (["answered"], {}),
    # A stack on the wall clock is never driven faster than real time, but may answer at once.
    "no answer yet, on the wall clock": ([], {"real_time": True}),
    "an answer, on the wall clock": (["answered"], {"real_time": True}),
    # After a missed answer it goes on at the pace of real time, until the next one.
    "a missed answer is late once while the stack is alive": (
        ["answered", *200 * ["feedback"]], {}),
    "answered again": (["answered", "feedback", "answered"], {}),
    "one that lags is waited for before its first answer too": (
        ["lagging more"], {"real_time": True}),
    "silence after an answer": (["answered", *1000 * ["nothing"]], {"late": 0.99}),
    "silence that an answer ends": (
        2 * ["answered", *100 * ["nothing"]], {"late": 0.99}),
    "silence from the start": (1000 * ["nothing"], {}),
    "half of the answers are late": (1000 * ["answered", "feedback"], {}),
    "pauses between waypoints do not make a short run an error": (
        5 * ["answered", *100 * ["feedback"]], {}),
    "a steady lag of stamps is taken for what it is": (6 * ["lagging"], {}),
    "commands far behind are no answers": (["answered", "far behind"], {}),
    "that commands without stamp are a guess is said once": (2 * ["without a stamp"], {}),
}  # fmt: skip


def told(answers, late=0.05, real_time=False):
    """Yield what is said of answers to cycles with an active goal, and how long the next waits."""
    steps = LockStep(read_settings({"launch": "nav", "late": late}), real_time=real_time)
    results = []
    try:
        for name in answers:
            latency, said = steps.take(*ANSWERS[name], active=True)
            results.append(f"{name}: {latency}" + "".join(f"; {one.text}" for one in said))
        steps.check_share()
    except SutFailure as failure:
        results.append(f"given up: {failure}")
    for result, same in groupby(results):
        yield f"{len(list(same))} x {result}"
    yield f"late {steps.late} of {steps.expected}, tolerance {steps.tolerance} s"
    with_goal, without, again = (steps.wait(active=active) for active in (True, False, True))
    # The next goal begins freely again.
    yield f"waits {with_goal} s with a goal, {without} s without, then {again} s"


def test_cycles_wait_as_long_as_an_answer_is_due(golden):
    lines = []
    for name, (answers, keys) in CASES.items():
        lines += [f"--- {name}", *told(answers, **keys)]
    golden("lockstep.txt", "\n".join(lines) + "\n")


def test_latency_is_told_for_answers_that_were_due_only():
    steps = LockStep(read_settings({"launch": "nav"}), real_time=False)
    assert steps.take(*ANSWERS["answered"], active=False) == (None, [])
