"""Where passing ends and failing begins, over one range or two."""

import math

from tests.analysis.search.spaces import ranged, search_task, searched


def circle(point):
    """Fails within 2.7 of (4, 6)."""
    return math.hypot(float(point[0]) - 4.0, float(point[1]) - 6.0) - 2.7


def test_one_parameter_is_halved_down_to_its_step():
    task = search_task(ranged(step=0.001), method="boundary", runs=60, window=1)
    done = searched(task, lambda p: float(p[0]) - 3.337, 60)
    failing = max(float(p.values[0]) for p, value in done if value is not None and value < 0.0)
    passing = min(float(p.values[0]) for p, value in done if value is not None and value >= 0.0)
    assert (failing, passing) == (3.336, 3.337)


def test_every_change_of_sign_is_found():
    task = search_task(ranged(), method="boundary", runs=60)
    done = searched(task, lambda p: math.sin(float(p[0])), 60)
    for zero in (math.pi, 2 * math.pi, 3 * math.pi):
        assert min(abs(float(p.values[0]) - zero) for p, _ in done) < 0.1


def test_over_two_parameters_points_lie_along_the_boundary():
    task = search_task(ranged(), ranged("b"), method="boundary", runs=120)
    done = searched(task, circle, 120)
    coarse = [abs(circle(p.values)) for p, _ in done if not p.guided]
    fine = [abs(circle(p.values)) for p, _ in done if p.guided]
    assert 55 <= len(coarse) <= 70
    assert sum(fine) / len(fine) < 0.5 * sum(coarse) / len(coarse)
    angles = {
        round(math.atan2(float(b) - 6.0, float(a) - 4.0))
        for a, b in (p.values for p, _ in done if p.guided and abs(circle(p.values)) < 0.7)
    }
    assert angles == {-3, -2, -1, 0, 1, 2, 3}


def test_without_a_change_of_sign_it_looks_where_the_margin_is_small():
    task = search_task(ranged(), ranged("b"), method="boundary", runs=80)
    done = searched(task, lambda p: circle(p) + 3.0, 80)
    near = [math.hypot(float(p.values[0]) - 4.0, float(p.values[1]) - 6.0) for p, _ in done]
    guided = [distance for (p, _), distance in zip(done, near, strict=True) if p.guided]
    assert sorted(guided)[len(guided) // 2] < 2.5


def test_runs_without_a_value_do_not_stop_it():
    task = search_task(ranged(), ranged("b"), method="boundary", runs=80)
    done = searched(task, lambda p: None if p[0] > 5.0 else circle(p), 80)
    assert len(done) == 80
    assert sum(p.guided for p, _ in done) > 20


def test_what_is_not_allowed_is_left_out_of_the_mesh():
    task = search_task(ranged(), ranged("b"), method="boundary", runs=80, constraints=("a < b",))
    done = searched(task, circle, 80)
    assert all(float(p.values[0]) < float(p.values[1]) for p, _ in done[1:])
    assert sum(p.guided for p, _ in done) > 20
