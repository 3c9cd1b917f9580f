"""Numbers of the published experiment, read from the files of its publication."""

import gzip
import io
import json
from xml.etree import ElementTree

import numpy as np
from PIL import Image

from grammars.floorplan import load_floorplan
from grammars.model.mission_files import load_mission

WORLDS = (
    "brsu_building_c_static",
    "brsu_building_c_dynamic",
    "brsu_building_c_adversarial_events",
    "brsu_building_c_no_events",
)
_DOOR = "door-instance-"
_TAGS = ("position", "x", "y", "near")


def published_figures(folder):
    """Return the figures of the files below ``folder``: missions, doors, key frames, plan, map."""
    return {
        "missions": {
            path.stem: [[w.x, w.y, w.yaw] for w in load_mission(path)[0].waypoints]
            for path in sorted((folder / "missions").glob("*.yaml"))
        },
        "doors": {name: doors_of(folder / "worlds" / f"{name}.world") for name in WORLDS},
        "key frames": {
            path.name: [[f["time"], f["pose"]] for f in json.loads(path.read_text())["keyframes"]]
            for path in sorted((folder / "keyframes").glob("*.json"))
        },
        "plan": plan_of(folder / "floorplans" / "brsu_building_c_with_doorways.fpm"),
        "map": map_of(folder / "maps" / "brsu_building_c_dynamic.pgm.gz"),
    }


def doors_of(world):
    """Return the doors of a world by our names: pose, whether they are fixed, their plug-in."""
    doors = {}
    for part in ElementTree.parse(world).getroot().iter("include"):
        name = part.findtext("name") or ""
        if name.startswith(_DOOR):
            x, y, _, _, _, yaw = map(float, (part.findtext("pose") or "").split())
            door = {"pose": [x, y, yaw], "fixed": part.findtext("static") == "true"}
            for plugin in part.findall("plugin"):
                door["plugin"] = plugin.get("filename")
                door |= {
                    tag: float(plugin.findtext(tag))
                    for tag in _TAGS
                    if plugin.find(tag) is not None
                }
                if uri := plugin.findtext("uri"):
                    door["key frames"] = uri.rpartition("/")[2]
            doors[f"door_{name.removeprefix(_DOOR)}"] = door
    return doors


def plan_of(path):
    """Return the walls and doorways of a floor plan: frames, lengths, thicknesses, centres."""
    plan = load_floorplan(path)
    return {
        "walls": {
            w.id: _rounded(w.frame.x, w.frame.y, w.frame.yaw, w.length, w.thickness)
            for w in plan.walls
        },
        "doorways": {o.name: _rounded(*o.centre) for o in plan.openings},
    }


def _rounded(*numbers):
    return [round(number, 6) + 0.0 for number in numbers]


def map_of(path):
    """Return the size of a map in cells, and the occupied cells of its squares."""
    image = np.flipud(np.asarray(Image.open(io.BytesIO(gzip.decompress(path.read_bytes())))))
    return {"shape": list(image.shape), "occupied": occupied_of(image == 0)}


def occupied_of(cells):
    """Return how many cells of each square of 100 x 100 are occupied, from the origin on."""
    starts = [range(0, length, 100) for length in cells.shape]
    sums = np.add.reduceat(np.add.reduceat(cells.astype(int), starts[0], axis=0), starts[1], axis=1)
    return sums.tolist()
