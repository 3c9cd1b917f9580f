import math
from dataclasses import fields

import pytest
from pydantic import ValidationError

from daemon.stacks.ros1.amcl import AmclParameters


def test_defaults_are_those_of_noetic():
    p = AmclParameters()
    assert (p.min_particles, p.max_particles, p.resample_interval) == (100, 5000, 2)
    assert (p.kld_err, p.kld_z) == (0.01, 0.99)
    assert (p.update_min_d, p.update_min_a) == (0.2, math.pi / 6.0)
    assert (p.laser_max_beams, p.laser_model_type, p.odom_model_type) == (
        30, "likelihood_field", "diff",
    )  # fmt: skip
    assert (p.laser_z_hit, p.laser_z_rand) == (0.95, 0.05)
    assert {getattr(p, f"odom_alpha{k}") for k in range(1, 6)} == {0.2}
    assert (p.recovery_alpha_slow, p.recovery_alpha_fast) == (0.001, 0.1)
    assert (p.initial_cov_xx, p.initial_cov_yy) == (0.25, 0.25)
    assert math.sqrt(p.initial_cov_aa) == pytest.approx(math.radians(15.0))


@pytest.mark.parametrize(
    ("name", "value"),
    [
        ("min_particles", 0),
        ("max_particles", 2000.5),
        ("kld_err", 0.0),
        ("update_min_d", -0.1),
        ("resample_interval", 0),
        ("laser_max_beams", 1),
        ("laser_sigma_hit", 0.0),
        ("odom_alpha1", math.nan),
        ("recovery_alpha_fast", 1.5),
    ],
)
def test_a_value_out_of_range_is_refused(name, value):
    with pytest.raises(ValidationError, match=name):
        AmclParameters(**{name: value})


def test_an_unknown_model_is_answered_with_the_known_ones():
    with pytest.raises(ValidationError, match="likelihood_field"):
        AmclParameters(laser_model_type="likelihood")
    with pytest.raises(ValidationError, match="omni-corrected"):
        AmclParameters(odom_model_type="ackermann")


@pytest.mark.parametrize(
    ("refused", "words"),
    [
        ({"laser_model_type": "beam"}, "not built in: write likelihood_field"),
        ({"laser_model_type": "likelihood_field_prob"}, "not built in: write likelihood_field"),
        ({"selective_resampling": True}, "not built in: write false"),
    ],
)
def test_what_is_not_built_in_is_refused(refused, words):
    with pytest.raises(ValidationError, match=words):
        AmclParameters(**refused)


def test_more_particles_at_least_than_at_most_are_refused():
    (objection,) = AmclParameters(min_particles=600, max_particles=500).rules()
    assert objection.fatal
    assert objection.text.startswith("min_particles (600) is more than max_particles (500)")
    assert not list(AmclParameters(min_particles=500, max_particles=500).rules())


def test_a_parameter_either_has_an_effect_or_a_reason_why_not():
    names = {field.name for field in fields(AmclParameters)}
    idle = AmclParameters.without_effect.keys()
    assert not names & idle
    assert {"gui_publish_rate", "save_pose_rate", "initial_pose_a"} <= idle
