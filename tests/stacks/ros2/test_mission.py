"""Missions as goals: what is sent when, and what results mean; ``missions.txt`` has it."""

from dataclasses import replace

from daemon.model.sut import SutFailure
from daemon.stacks.ros2.link import GoalUpdate
from daemon.stacks.ros2.mission import GoalSequence
from grammars.model.geometry import Pose2
from grammars.model.mission import Mission, Waypoint
from tests.stacks.ros2.pretended_link import PretendedLink

MISSION = Mission(
    "courier",
    Pose2(0.0, 0.0, 0.0),
    (Waypoint("desk", 2.0, 0.0, 1.0), Waypoint("door", 2.0, 3.0), Waypoint("home", 0.0, 3.0, 0.5)),
)
SEND = "send the next goal"


def ends(goal, state="succeeded", *more, **values):
    return GoalUpdate(goal, state, *more, **values)


def feedback(**values):
    return GoalUpdate(0, "feedback", **values)


BEGUN = [SEND, ends(0, "accepted")]
TIMED_OUT = (
    'Timed out while waiting for action server to acknowledge goal request for "follow_path"'
)
CONVERSATIONS = {
    "each is sent when the one before is reached; any heading is that of the way there": (
        "waypoints",
        [*BEGUN, SEND, ends(0), SEND, ends(1, "accepted"), ends(1), SEND, ends(2, "accepted"),
         ends(2), SEND]),
    "all in one, counted by the current one; not backwards, nor to the end before the result": (
        "follow",
        [*BEGUN, *(feedback(current_waypoint=n) for n in (1, 0, 3, 9)), ends(0)]),
    "all in one, counted by those that remain": (
        "through",
        [*BEGUN, *(feedback(number_of_poses_remaining=n) for n in (2, 3, 0)),
         feedback(current_waypoint=9), ends(0)]),
    "a waypoint was missed": (
        "follow", [*BEGUN, ends(0, missed_waypoints=(1,))]),
    "aborted": ("waypoints", [*BEGUN, ends(0, "aborted", 105, "no valid path")]),
    "aborted after a lost acknowledgement, which is the machine's doing": (
        "waypoints", [*BEGUN, TIMED_OUT, ends(0, "aborted")]),
    "rejected": ("waypoints", [SEND, ends(0, "rejected")]),
    "unanswered": ("waypoints", [SEND, ends(0, "unanswered")]),
    "what comes of a goal that is over": (
        "waypoints", [*BEGUN, ends(0), SEND, ends(0, "aborted")]),
    "recoveries are told as their number grows": (
        "waypoints", [*BEGUN, *(feedback(number_of_recoveries=n) for n in (0, 1, 1, 2))]),
}  # fmt: skip


def conversation(mode, steps):
    """Yield what is sent and told, and how far it is, after each step."""
    link = PretendedLink()
    goals = GoalSequence(MISSION, mode, link, "map")
    for time, step in enumerate(steps):
        yield f"{step if isinstance(step, str) else f'goal {step.goal} {step.state}'}"
        sent = len(link.goals)
        try:
            said = goals.take(step) if isinstance(step, GoalUpdate) else ()
        except SutFailure as failure:
            yield f"=> failure: {failure}"
            return
        if step == SEND:
            goals.send_next(time)
        elif isinstance(step, str):
            goals.hear_log(step)
        yield from (f"=> sent {goal}" for goal in link.goals[sent:])
        yield from (f"=> {event.level}: {event.text}" for event in said)
        state = goals.progress
        is_active = "active" if goals.active else "no goal"
        yield f"=> {state.reached} reached, {state.current} {state.state}, {is_active}"


def test_the_next_goal_waits_until_the_stay_is_over():
    link = PretendedLink()
    desk, door, _ = MISSION.waypoints
    stays = replace(MISSION, waypoints=(replace(desk, wait=2.0), replace(door, wait=1.0)))
    goals = GoalSequence(stays, "waypoints", link, "map")
    sent = []
    for time, ended in [(0, None), (5, 0), (6, None), (7.9, None), (8, 1), (9, None), (9.9, None)]:
        goals.send_next(round(time * 1e9))
        sent += [time] * (len(link.goals) - len(sent))
        if ended is not None:
            goals.take(ends(ended))
    # The clock of a stay begins with the cycle after the result.
    assert (sent, goals.progress.reached, goals.progress.state) == ([0, 8], 2, "active")
    goals.send_next(round(10e9))
    assert goals.progress.state == "succeeded"


def test_goals_and_what_comes_of_them(golden):
    lines = []
    for name, (mode, steps) in CONVERSATIONS.items():
        lines += [f"--- {name} ({mode})", *conversation(mode, steps)]
    golden("missions.txt", "\n".join(lines) + "\n")
