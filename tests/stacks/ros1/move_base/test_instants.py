"""move_base instant by instant: states, plans, commands and recoveries.

What is expected was followed on paper through the published move_base (Noetic): ``executeCb``,
``executeCycle``, ``planThread`` and ``resetState`` of ``move_base.cpp``, and ``ros::Rate::sleep``.
Controlling is due every 0.1 s from the goal on; the planner thread has its turn every 0.05 s,
before the control loop: a wake-up of the one is heard by the other at the next instant.
"""

import pytest

from grammars.model.geometry import Pose2, Twist2
from tests.stacks.ros1.move_base.bench import FORWARD, Bench

STILL = Twist2()


def close(times):
    return pytest.approx(times, abs=1e-6)


def started(bench, until, begin=0.0):
    bench.now = begin
    bench.accept()
    return bench.run(until)


def failing(*, since, until=1e9):
    """A controller, or a planner, that fails in [since, until)."""
    return lambda now: not since - 1e-6 < now < until - 1e-6


def states(bench):
    return [(round(time, 2), state[:5]) for time, state in bench.states]


def still(bench):
    return [round(time, 2) for time, command in bench.commands if command == STILL]


def forward(bench):
    return [round(time, 2) for time, command in bench.commands if command == FORWARD]


def tried(bench):
    return [(round(time, 2), name) for time, name in bench.tried]


# executeCb: zero velocity, the planner is woken; its thread plans at the next instant and sets
# CONTROLLING; then every 1 / planner_frequency from the start of a plan, or with 0 never again.
@pytest.mark.parametrize(
    ("frequency", "planned"),
    [
        (0.0, [0.05]),
        (5.0, [0.05, 0.25, 0.45, 0.65, 0.85]),
        (2.0, [0.05, 0.55]),
        # 0.333 s later than 0.05 is 0.4 in steps of 0.05, and so on.
        (3.0, [0.05, 0.4, 0.75]),
    ],
)
def test_a_goal_is_planned_for_at_once_and_then_at_the_frequency(frequency, planned):
    bench = started(Bench(parameters={"planner_frequency": frequency}), 1.0)
    assert bench.planned == close(planned)
    assert states(bench) == [(0.05, "contr")]
    assert forward(bench) == [0.1, 0.2, 0.3, 0.4, 0.5, 0.6, 0.7, 0.8, 0.9, 1.0]
    assert bench.controller.plans == len(planned)


# A failing controller sets PLANNING and wakes the planner, which sets its timer anew.
def test_a_plan_out_of_turn_moves_the_turns():
    bench = started(Bench(works=lambda now: abs(now - 0.9) > 1e-6), 1.5)
    assert bench.planned == close([0.05, 0.25, 0.45, 0.65, 0.85, 0.95, 1.15, 1.35])
    assert states(bench) == [(0.05, "contr"), (0.9, "plann"), (0.95, "contr")]
    assert still(bench) == [0.9]


def test_with_a_frequency_of_zero_a_failing_controller_is_the_only_reason_to_plan_again():
    works = failing(since=0.5, until=0.7)
    bench = started(Bench(works=works, parameters={"planner_frequency": 0.0}), 1.2)
    assert bench.planned == close([0.05, 0.55, 0.65])
    assert still(bench) == [0.5, 0.6]
    assert not bench.status.planner_runs


# planThread: now > last_valid_plan + planner_patience, or more failures than max_planning_retries.
# In PLANNING every control cycle wakes it: it tries at 0.05, 0.15, 0.25, ...
@pytest.mark.parametrize(
    ("begin", "parameters", "given_up"),
    [
        (0.0, {"planner_patience": 0.9}, 0.95),
        # The end of the patience itself is not late, in whichever way 0.3 + 0.15 is rounded.
        (0.0, {"planner_patience": 0.95}, 1.05),
        (0.3, {"planner_patience": 0.15}, 0.55),
        (0.95, {"planner_patience": 0.15}, 1.2),
        (0.0, {"planner_patience": 0.0}, 0.05),
        (0.0, {"max_planning_retries": 0}, 0.05),
        (0.0, {"max_planning_retries": 3}, 0.35),
        (0.0, {"max_planning_retries": 3, "planner_patience": 0.2}, 0.25),
        (0.0, {"max_planning_retries": -1, "planner_patience": 2.0}, 2.05),
    ],
)
def test_the_planner_gives_up_after_its_patience_or_its_retries(begin, parameters, given_up):
    bench = Bench(plans=lambda now: False, parameters=parameters)
    started(bench, given_up, begin)
    assert states(bench)[-1] == (given_up, "clear")
    # The thread stops the robot and forbids itself to plan on.
    assert still(bench) == [given_up]
    assert not bench.status.planner_runs
    # The first recovery in the cycle after and PLANNING again; one cycle later a wake-up.
    bench.run(given_up + 0.2)
    assert tried(bench) == [(round(given_up + 0.05, 2), "r0")]
    assert (round(given_up + 0.05, 2), "plann") in states(bench)
    assert bench.planned[-1] == pytest.approx(given_up + 0.2)
    assert bench.planned[-2] == pytest.approx(given_up)
    assert [time for time in still(bench) if time < given_up + 0.15] == [given_up]


def test_retries_are_counted_anew_after_a_recovery_and_a_plan():
    bench = Bench(plans=failing(since=0.0, until=0.8), parameters={"max_planning_retries": 3})
    # Tries 0.05 to 0.35, recovery at 0.4, cycle at 0.5; tries 0.55 to 0.75, plan at 0.85.
    started(bench, 1.0)
    assert bench.planned == close([0.05, 0.15, 0.25, 0.35, 0.55, 0.65, 0.75, 0.85])
    assert tried(bench) == [(0.4, "r0")]
    assert bench.status.planning_retries == 0
    assert forward(bench) == [0.9, 1.0]


# executeCycle, CONTROLLING: now > last_valid_control + controller_patience. Until then each failure
# means PLANNING and a plan half a cycle later; afterwards CLEARING, a recovery in the next cycle,
# PLANNING, a plan when the timer says so, and failing again, as last_valid_control stays.
def test_after_the_controller_s_patience_all_recoveries_follow_at_once():
    works = failing(since=1.0)
    bench = started(Bench(works=works, parameters={"controller_patience": 0.5}), 5.0)
    # The last command was at 0.9: 1.4 is not late yet, 1.5 is. Woken from 1.05 to 1.45; from then
    # on every 0.2 s, as recoveries do not keep the thread from planning.
    turns = [0.05, 0.25, 0.45, 0.65, 0.85]
    woken = [1.05, 1.15, 1.25, 1.35, 1.45]
    assert bench.planned == close([*turns, *woken, 1.65, 1.85, 2.05, 2.25])
    assert states(bench)[9:] == [
        (1.4, "plann"), (1.45, "contr"), (1.5, "clear"), (1.6, "plann"), (1.65, "contr"),
        (1.7, "clear"), (1.8, "plann"), (1.85, "contr"), (1.9, "clear"), (2.0, "plann"),
        (2.05, "contr"), (2.1, "clear"), (2.2, "plann"), (2.25, "contr"), (2.3, "clear"),
        (2.4, "plann"),
    ]  # fmt: skip
    assert tried(bench) == [(1.6, "r0"), (1.8, "r1"), (2.0, "r2"), (2.2, "r3")]
    assert still(bench) == [1.0, 1.1, 1.2, 1.3, 1.4, 1.5, 1.7, 1.9, 2.1, 2.3, 2.4]
    assert bench.result == "aborted"
    assert bench.said("goal aborted: no valid velocity command, even after recoveries") == 1


def test_a_plan_made_while_clearing_is_due_takes_the_state_back():
    """The thread sets CONTROLLING whatever the state is, as long as it may plan.

    At 20 Hz it makes a plan between any two control cycles: CLEARING never lasts until the next
    one, no recovery is ever begun, and the goal is never given up.
    """
    parameters = {"planner_frequency": 20.0, "controller_patience": 0.5}
    bench = started(Bench(works=failing(since=1.0), parameters=parameters), 30.0)
    assert states(bench)[-2:] == [(29.95, "contr"), (30.0, "clear")]
    assert tried(bench) == []
    assert bench.result is None
    assert still(bench)[-3:] == [29.8, 29.9, 30.0]


# recovery_index_ goes back to the first behaviour with a command after CONTROLLING_R, a plan after
# PLANNING_R, and a move after OSCILLATION_R.
def test_a_command_gives_back_the_recoveries_that_a_failing_controller_used():
    def works(now):
        return failing(since=1.0, until=1.85)(now) and failing(since=3.0)(now)

    bench = started(Bench(works=works, parameters={"controller_patience": 0.5}), 9.0)
    # r1 at 1.8, a plan at 1.85, a command at 1.9. From 3.0 on as above, two seconds later.
    assert tried(bench) == [
        (1.6, "r0"), (1.8, "r1"), (3.6, "r0"), (3.8, "r1"), (4.0, "r2"), (4.2, "r3"),
    ]  # fmt: skip
    assert bench.now == pytest.approx(4.4)


def test_a_plan_gives_back_the_recoveries_that_a_failing_planner_used():
    def plans(now):
        return not (now < 0.6 or 2.0 < now < 3.0)

    parameters = {"planner_frequency": 0.0, "max_planning_retries": 1}
    bench = Bench(plans=plans, works=failing(since=2.0, until=2.05), parameters=parameters)
    # Without a frequency the thread tries at every turn: at 0.05 and at 0.1, once too often. The
    # cycle of that instant recovers, the next one wakes it: 0.25 and 0.3, 0.45 and 0.5; a plan at
    # 0.65. The second time, from 2.05 on, it begins with r0 again.
    started(bench, 2.15)
    assert bench.planned == close([0.05, 0.1, 0.25, 0.3, 0.45, 0.5, 0.65, 2.05, 2.1])
    assert tried(bench) == [(0.1, "r0"), (0.3, "r1"), (0.5, "r2"), (2.1, "r0")]


def test_a_plan_gives_nothing_back_to_a_robot_that_does_not_get_on():
    parameters = {"oscillation_timeout": 1.0}
    bench = started(Bench(speed=0.0, parameters=parameters), 9.0)
    # 0 + 1.0 < now from 1.1 on: zero, then a command nevertheless; r0 at 1.2, which begins the
    # second anew. Plans come at 1.25, 1.45, ... and leave the index alone.
    assert tried(bench) == [(1.2, "r0"), (2.4, "r1"), (3.6, "r2"), (4.8, "r3")]
    assert bench.now == pytest.approx(6.0)
    assert bench.said("goal aborted: it does not get on, even after recoveries") == 1
    assert still(bench) == [6.0], "of zero and a command at 1.1 the command is the last one"
    assert 1.1 in forward(bench)
    assert 1.2 not in forward(bench)


def test_a_plan_between_two_cycles_delays_the_recovery_of_a_robot_that_does_not_get_on():
    # CLEARING at 1.0, CONTROLLING with the plan of 1.05; CLEARING again at 1.1, none until 1.25.
    bench = started(Bench(speed=0.0, parameters={"oscillation_timeout": 0.9}), 1.3)
    assert states(bench) == [
        (0.05, "contr"), (1.0, "clear"), (1.05, "contr"), (1.1, "clear"), (1.2, "plann"),
        (1.25, "contr"),
    ]  # fmt: skip
    assert tried(bench) == [(1.2, "r0")]


@pytest.mark.parametrize(
    ("steps", "recovers"),
    [
        # 0.2 m in any direction count, at 0.4, 0.7, 1.0 and 1.3: it has until 2.3. Less does not,
        # and counts from where it last was enough: from (3, 4), as it began 5 m from (0, 0).
        ([(3.2, 4.0), (3.2, 3.8), (3.0, 3.8), (3.13, 3.96)], 2.5),
        ([(3.1, 4.1), (3.0, 4.19), (2.9, 3.9), (3.0, 3.81)], 1.2),
        ([(3.15, 4.15), (3.0, 4.0), (2.85, 3.85), (3.0, 4.0)], 2.5),
    ],
)
def test_to_get_on_is_to_leave_the_place_where_it_last_did(steps, recovers):
    parameters = {"oscillation_timeout": 1.0, "planner_frequency": 0.0}
    bench = Bench(speed=0.0, parameters=parameters)
    bench.pose = Pose2(3.0, 4.0)
    bench.accept()
    for number, (x, y) in enumerate(steps):
        bench.run(0.3 * (number + 1) + 0.05)
        bench.pose = Pose2(x, y)
    bench.run(4.0)
    assert tried(bench)[0] == (recovers, "r0")


@pytest.mark.parametrize(("begin", "timeout"), [(0.1, 0.7), (0.2, 0.7), (0.6, 0.3)])
def test_the_end_of_the_oscillation_timeout_itself_is_not_late(begin, timeout):
    # In double precision 0.1 + 0.7 is 0.7999999999999999.
    bench = Bench(speed=0.0, parameters={"oscillation_timeout": timeout, "planner_frequency": 0.0})
    started(bench, begin + 2.0, begin)
    assert tried(bench)[0] == (round(begin + timeout + 0.2, 2), "r0")


def test_a_failing_controller_puts_off_the_recoveries_of_oscillation():
    """Both in one cycle: CLEARING of the one is overwritten with PLANNING of the other.

    That goes on until the controller's patience is over as well, and is then its recovery.
    """
    parameters = {"oscillation_timeout": 0.5, "controller_patience": 1.0}
    bench = Bench(speed=0.0, works=lambda now: False, parameters=parameters)
    started(bench, 1.2)
    assert {state for _, state in states(bench)[:-2]} == {"plann", "contr"}
    assert states(bench)[-2:] == [(1.1, "clear"), (1.2, "plann")]
    assert tried(bench) == [(1.2, "r0")]
    assert bench.said("r0: no valid velocity command") == 1


def test_to_arrive_comes_before_everything_else():
    bench = Bench(speed=0.0, works=failing(since=0.9), parameters={"oscillation_timeout": 0.5})
    bench.controller.arrived = True
    started(bench, 0.2)
    assert bench.result == "succeeded"
    assert bench.now == pytest.approx(0.1)
    assert bench.commands == [(pytest.approx(0.1), STILL)]
    assert (bench.status.planner_runs, bench.status.goal) == (False, None)


# ros::Rate::sleep after a behaviour that took its time: a loop that is late runs at once and keeps
# its beat, unless it is late by more than a whole period: then it begins a new one.
@pytest.mark.parametrize(
    ("lasts", "commands"),
    [
        # Begun at 1.2. Over at 1.25: the next cycle is that of 1.3, woken, a plan, 1.4.
        (0.05, [1.4, 1.5]),
        # Over at 1.3: as if nothing had been.
        (0.1, [1.4, 1.5]),
        # Over at 1.35: a cycle at once and the next one at 1.4, with the plan of that instant.
        (0.15, [1.4, 1.5]),
        # Over at 1.45, 0.05 s late for the second one: at once, then 1.55.
        (0.25, [1.55, 1.65]),
        (1.0, [2.3, 2.4]),
    ],
)
def test_the_beat_of_the_loop_after_a_recovery(lasts, commands):
    parameters = {"oscillation_timeout": 1.0, "planner_frequency": 0.0}
    bench = Bench(speed=0.0, recoveries=(lasts,), parameters=parameters)
    started(bench, 3.0)
    assert tried(bench)[0] == (1.2, "r0")
    assert [time for time in forward(bench) if time > 1.15][:2] == commands


def test_the_planner_goes_on_during_a_recovery_that_it_has_not_asked_for():
    parameters = {"oscillation_timeout": 1.0}
    bench = Bench(speed=0.0, recoveries=(1.0,), parameters=parameters)
    started(bench, 2.35)
    # Plans set CONTROLLING while the turn blocks the loop; its end at 2.2 sets PLANNING. That very
    # instant has a cycle of its own, which wakes the thread.
    assert [t for t in bench.planned if t > 1.1] == close([1.25, 1.45, 1.65, 1.85, 2.05, 2.25])
    assert states(bench)[-3:] == [(1.25, "contr"), (2.2, "plann"), (2.25, "contr")]
    assert [time for time in forward(bench) if time > 1.1] == [2.3]


def test_the_planner_rests_during_a_recovery_that_it_has_asked_for():
    parameters = {"max_planning_retries": 0}
    bench = Bench(plans=failing(since=0.0, until=1.0), recoveries=(1.0,), parameters=parameters)
    started(bench, 1.3)
    # Given up at 0.05, recovery from 0.1 to 1.1, a cycle at once, its wake-up at 1.15.
    assert bench.planned == close([0.05, 1.15])
    assert states(bench) == [(0.05, "clear"), (1.1, "plann"), (1.15, "contr")]
    assert forward(bench) == [1.2, 1.3]


def test_a_new_goal_begins_with_new_patience_but_where_the_robot_was_seen_to_move_last():
    bench = Bench(speed=0.2, parameters={"oscillation_timeout": 1.0, "oscillation_distance": 0.2})
    started(bench, 1.75)
    bench.controller.arrived = True
    bench.run(3.0)
    assert (bench.result, round(bench.now, 2)) == ("succeeded", 1.8)
    # It drove from 0.1 on, 0.2 m by 1.1; at 1.8 it is at 0.34 m and has 0.06 m to go until it
    # counts as moving: with the plan at 2.05 and commands from 2.1 on that is at 2.4.
    bench.result, bench.controller.arrived = None, False
    bench.now = 2.0
    bench.accept()
    bench.speed = 0.2
    bench.run(3.35)
    assert tried(bench) == []
    bench.speed = 0.0
    bench.run(3.6)
    assert tried(bench) == [(3.6, "r0")]
