"""Occupancy grids: read from map files, distances to obstacles, the cheapest way, a scan's fit."""

from __future__ import annotations

import heapq
import math
from dataclasses import dataclass

import numpy as np
import yaml

_REACH = 1.0
"""Distances to obstacles are known up to here [m]; more costs time and changes no plan."""
_NEIGHBOURS = [
    (dx, dy, math.hypot(dx, dy)) for dx in (-1, 0, 1) for dy in (-1, 0, 1) if (dx, dy) != (0, 0)
]


@dataclass(frozen=True, eq=False)
class Grid:
    """Cells of nav_msgs/OccupancyGrid, row 0 at the bottom; `x`, `y` is the lower left corner."""

    resolution: float
    x: float
    y: float
    cells: np.ndarray


def read_map(file):
    """A map.yaml with its PGM (binary), trinary as `nav2_map_server` reads it."""
    meta = yaml.safe_load(file.read_text("utf-8"))
    data = (file.parent / meta["image"]).read_bytes()
    words = []
    at = 0
    while len(words) < 4:
        end = data.index(b"\n", at)
        words += data[at:end].split(b"#")[0].split()
        at = end + 1
    if words[0] != b"P5":
        raise ValueError(f"{meta['image']}: not a binary PGM")
    width, height = int(words[1]), int(words[2])
    grey = np.frombuffer(data, np.uint8, width * height, at).reshape(height, width)
    occupancy = (255 - grey.astype(float)) / 255
    cells = np.full(grey.shape, -1, np.int8)
    cells[occupancy > meta["occupied_thresh"]] = 100
    cells[occupancy < meta["free_thresh"]] = 0
    return Grid(meta["resolution"], *meta["origin"][:2], np.flipud(cells).copy())


def from_message(message):
    """Of a nav_msgs/OccupancyGrid that is not turned."""
    cells = np.array(message.data, np.int8).reshape(message.info.height, message.info.width)
    origin = message.info.origin.position
    return Grid(message.info.resolution, origin.x, origin.y, cells)


class DistanceField:
    """Distance to the nearest occupied cell [m], exact up to 1 m and 1 m beyond that."""

    def __init__(self, grid, solid):
        self.grid = grid
        reach = round(_REACH / grid.resolution)
        row = np.where(solid, 0.0, reach)
        for step in range(1, reach + 1):
            row[:, step:][solid[:, :-step]] = np.minimum(row[:, step:][solid[:, :-step]], step)
            row[:, :-step][solid[:, step:]] = np.minimum(row[:, :-step][solid[:, step:]], step)
        squared = row**2
        best = squared.copy()
        for step in range(1, reach + 1):
            best[step:] = np.minimum(best[step:], squared[:-step] + step * step)
            best[:-step] = np.minimum(best[:-step], squared[step:] + step * step)
        self.distance = np.minimum(np.sqrt(best) * grid.resolution, _REACH)
        self.slope_y, self.slope_x = np.gradient(self.distance, grid.resolution)

    def match(self, guess, points):
        """Move a pose so that the end points of a scan (base frame) lie on what is occupied.

        Gauss-Newton on the distance field; points farther than 0.3 m from anything on the map
        (doors, people) count for nothing, and the guess holds against too few points.
        """
        grid, pose = self.grid, np.array(guess)
        height, width = grid.cells.shape
        for _ in range(6):
            cos, sin = math.cos(pose[2]), math.sin(pose[2])
            turned = points @ np.array([[cos, sin], [-sin, cos]])
            place = (turned + pose[:2] - (grid.x, grid.y)) / grid.resolution
            cell = np.floor(place).astype(int)
            known = (cell >= 0).all(axis=1) & (cell[:, 0] < width) & (cell[:, 1] < height)
            cell, place, turned = cell[known], place[known], turned[known]
            gx, gy = self.slope_x[cell[:, 1], cell[:, 0]], self.slope_y[cell[:, 1], cell[:, 0]]
            off = (place - cell - 0.5) * grid.resolution
            error = self.distance[cell[:, 1], cell[:, 0]] + gx * off[:, 0] + gy * off[:, 1]
            near = np.abs(error) < 0.3
            if near.sum() < 30:
                return guess
            jacobian = np.stack([gx, gy, gy * turned[:, 0] - gx * turned[:, 1]], axis=1)[near]
            normal = jacobian.T @ jacobian + np.diag([1.0, 1.0, 1.0])
            pose -= np.linalg.solve(normal, jacobian.T @ error[near])
        return float(pose[0]), float(pose[1]), float(pose[2])


class Planner:
    """A* over cells of 0.1 m; ways keep away from obstacles where there is room."""

    def __init__(self, grid, radius):
        # Unknown cells are no way either: a robot has nothing to do outside the building.
        field = DistanceField(grid, grid.cells != 0)
        self._step = max(1, round(0.1 / grid.resolution))
        self._size = grid.resolution * self._step
        self._grid = grid
        half = self._step // 2
        coarse = field.distance[half :: self._step, half :: self._step]
        self._free = coarse >= radius
        cost = 1.0 + 8.0 * np.clip((0.6 - coarse) / 0.6, 0.0, 1.0) ** 2
        # A list, whose elements are read faster; with a border, so that no cell is outside.
        self._cost = np.pad(np.where(self._free, cost, np.inf), 1, constant_values=np.inf).tolist()

    def plan(self, start, goal):
        """Points from start to goal [m], about 0.1 m apart; None if there is no way."""
        source, target = self._near(start), self._near(goal)
        if source is None or target is None:
            return None
        came = {}
        spent = {source: 0.0}
        queue = [(0.0, source)]
        done = set()
        while queue:
            _, cell = heapq.heappop(queue)
            if cell == target:
                break
            if cell in done:
                continue
            done.add(cell)
            for dx, dy, length in _NEIGHBOURS:
                other = (cell[0] + dy, cell[1] + dx)
                total = spent[cell] + length * self._cost[other[0] + 1][other[1] + 1]
                if total < spent.get(other, math.inf):
                    spent[other] = total
                    came[other] = cell
                    rest = math.hypot(target[0] - other[0], target[1] - other[1])
                    heapq.heappush(queue, (total + rest, other))
        if target not in came and target != source:
            return None
        cells = [target]
        while cells[-1] in came and cells[-1] != source:
            cells.append(came[cells[-1]])
        way = np.array([self._centre(cell) for cell in reversed(cells)])
        way = np.vstack([start[:2], way[1:-1], goal[:2]])
        for _ in range(4):
            way[1:-1] = (way[:-2] + 2 * way[1:-1] + way[2:]) / 4
        return [(float(x), float(y)) for x, y in way]

    def _centre(self, cell):
        half = (self._step // 2 + 0.5) * self._grid.resolution
        return (
            self._grid.x + cell[1] * self._size + half,
            self._grid.y + cell[0] * self._size + half,
        )

    def _near(self, pose):
        """The free cell nearest to a pose, at most 0.5 m away."""
        column = round((pose[0] - self._centre((0, 0))[0]) / self._size)
        row = round((pose[1] - self._centre((0, 0))[1]) / self._size)
        rows, columns = np.nonzero(self._free)
        if not rows.size:
            return None
        away = np.hypot(rows - row, columns - column)
        best = int(np.argmin(away))
        if away[best] * self._size > 0.5:
            return None
        return int(rows[best]), int(columns[best])
