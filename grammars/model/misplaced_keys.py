"""Keys that people write in a file of the wrong kind, with where they belong."""

from __future__ import annotations

from typing import Final

_IN_MISSIONS: Final = "it belongs in a mission file: NAME.mission.yaml"
_IN_ROBOTS: Final = "it belongs in a robot file: robots/NAME.yaml"
_IN_CAMPAIGNS: Final = "it belongs in the campaign file"
MISSION_KEYS: Final = dict.fromkeys(("start", "waypoints"), _IN_MISSIONS)
"""Keys that only mission files have, with where they belong."""
ROBOT_KEYS: Final = dict.fromkeys(
    ("footprint", "height", "mass", "drive", "laser", "lasers", "odometry"), _IN_ROBOTS
)
"""Keys that only robot files have, with where they belong."""
CAMPAIGN_KEYS: Final = dict.fromkeys(
    ("campaign", "repeats", "seed", "limit", "oracles", "scenarios", "floorplan", "objects",
     "behaviours", "matrix", "expect", "defaults", "robot", "mission", "sut"),
    _IN_CAMPAIGNS,
)  # fmt: skip
"""Keys of campaign files that people look for in other files, with where they belong."""
