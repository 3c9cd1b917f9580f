"""Oracles about joints are held against the scene of each scenario."""

import shutil

from daemon.campaign import load_campaign


def test_an_angle_no_door_comes_to_is_a_warning(tmp_path, campaigns):
    for part in ("demo", "robots", "suts"):
        shutil.copytree(campaigns / part, tmp_path / part)
    layer = tmp_path / "demo" / "navigation.oracles.yaml"
    text = layer.read_text("utf-8")
    lines = [line for line in text.splitlines() if not line.startswith("reached:")]
    lines.append("reached: eventually(kitchen_door.angle >= 400 deg)")
    layer.write_text("\n".join(lines) + "\n", "utf-8")
    warnings = [str(one) for one in load_campaign(tmp_path / "demo" / "campaign.yaml").warnings]
    (found,) = (one for one in warnings if "can never hold" in one)
    assert "navigation.oracles.yaml" in found
