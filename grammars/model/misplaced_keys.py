"""Keys that people write in the wrong kind of file, with the right place."""

from __future__ import annotations

from typing import Final

_IN_MISSIONS: Final = "it belongs in a mission file: NAME.mission.yaml"
_IN_ROBOTS: Final = "it belongs in a robot file: robots/NAME.yaml"
_IN_CAMPAIGNS: Final = "it belongs in the campaign file"
MISSION_KEYS: Final = dict.fromkeys(("start", "waypoints"), _IN_MISSIONS)
"""Keys of mission files."""
ROBOT_KEYS: Final = dict.fromkeys(
    ("footprint", "height", "mass", "drive", "laser", "lasers", "odometry"), _IN_ROBOTS
)
"""Keys of robot files."""
CAMPAIGN_KEYS: Final = dict.fromkeys(
    ("campaign", "repeats", "seed", "limit", "oracles", "scenarios", "floorplan", "objects",
     "behaviours", "matrix", "expect", "defaults", "robot", "mission", "sut"),
    _IN_CAMPAIGNS,
)  # fmt: skip
"""Keys of campaign files that people write in other files."""
