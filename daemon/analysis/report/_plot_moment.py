"""The ten seconds around the moment that decided a verdict, as a picture that moves by itself.

The movement is SMIL (``animateTransform``, ``animate``): no script, and nothing is fetched. Beside
what moves there is what it looks like at the moment itself; the page shows that one on paper and to
whoever asked for less motion, see ``.moving`` and ``.still`` in ``templates/report/report.css``.
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Final

import numpy as np

from daemon.analysis.report._recorded import sampled_trace
from daemon.analysis.report._safety_buffer import Indices, polygons_around, transform_points
from daemon.analysis.report._svg import (
    BAD,
    BODY,
    INK,
    LINE,
    RULE,
    SECOND,
    SOFT,
    WALL,
    attribute,
    colour_value,
    number,
    path_data,
    path_element,
    rings_data,
    stroke,
    style,
    text_element,
)
from daemon.judging.oracles import SignalSampler
from daemon.trace import TraceError
from grammars.model.geometry import Floats, Point2

_BEFORE, _AFTER = 7.0, 3.0
"""Seconds of the run that are shown around the moment."""
_HOLD, _REST = 1.5, 1.0
"""Seconds for which the picture stands still at the moment, and at the end."""
_RATE: Final = 8.0
"""Positions a second: what moves goes straight on between them."""
_LABEL: Final = 0.5
"""Seconds from one time that is shown to the next."""
_WIDTH: Final = 252.0
_FOOT: Final = 16.0
"""Width of the picture, and height of what is below the map [points]."""
_ASPECT: Final = 1.6
_ROOM: Final = 1.0
"""Room [m] around the places where the robot is."""
_NARROWEST: Final = 6.4
"""Width [m] of the map at least."""
_FLASH: Final = 0.6
"""Seconds for which a contact is shown."""
_STILL: Final = 1e-4
"""What moves less than this [m, rad] stands still."""


@dataclass(frozen=True, slots=True)
class MomentPicture:
    """What is drawn of a moment, below each other; lengths are in points."""

    height: float
    drawn: str

    def svg(self, name: str, label: str) -> str:
        """Return an ``<svg>`` element to stand inside of a page, as a sheet of axes has it."""
        size = f"{number(_WIDTH)} {number(self.height)}"
        box = f'width="{number(_WIDTH)}" height="{number(self.height - _FOOT)}"'
        return (
            f'<svg viewBox="0 0 {size}" role="img" aria-label="{attribute(label)}" '
            f'xmlns="http://www.w3.org/2000/svg" color="var(--{INK})">'
            f'<clipPath id="{name}-0"><rect {box}/></clipPath>'
            f"{self.drawn.replace(_CLIP, f'url(#{name}-0)')}</svg>"
        )


_CLIP: Final = "url(#)"


@dataclass(frozen=True, slots=True)
class _Timeline:
    """What is shown when: ``frames`` (n,) are indices of samples, evenly apart in the animation.

    ``times`` (n,) [s] of the run are those of the frames. The picture stands still at the moment
    from frame ``pause`` to ``resume``, and at the end from ``arrival`` on.
    """

    frames: Indices
    times: Floats
    pause: int
    resume: int
    arrival: int

    @property
    def moment(self) -> int:
        """The sample that is the moment."""
        return int(self.frames[self.pause])

    @property
    def last(self) -> int:
        """The last frame."""
        return len(self.frames) - 1

    @property
    def repeated(self) -> str:
        """How long an animation takes, as attributes: all of one picture begin and end together."""
        return f'dur="{self.last / _RATE:g}s" repeatCount="indefinite"'

    def share(self, frame: float) -> str:
        """Return when a frame is shown, 0 to 1."""
        return f"{min(max(frame / self.last, 0.0), 1.0):.3f}"

    def frame_at(self, time: float) -> int:
        """Return the frame at which a time [s] of the run begins to be shown."""
        return int(np.searchsorted(self.times, time))


@dataclass(frozen=True, slots=True)
class _MapFrame:
    """The part of the map that is shown: ``scale`` [points/m], its north-western corner [m]."""

    scale: float
    west: float
    north: float
    high: float

    def points(self, points: Floats) -> Floats:
        """Return points of the map (n, 2) on the picture."""
        return np.column_stack(
            ((points[:, 0] - self.west) * self.scale, (self.north - points[:, 1]) * self.scale)
        )

    def around(self, points: Floats) -> Floats:
        """Return points of a frame (n, 2) in its own directions, in points."""
        turned: Floats = points * np.array((self.scale, -self.scale))
        return turned


def plot_moment(trace: Path, time: float, involved: str, buffer: Point2) -> MomentPicture | None:
    """Return the seconds around ``time`` [s] of a run, the object ``involved`` in red.

    Around the robot its safety ``buffer``, half extents [m]. ``None`` if the trace cannot be read
    any more, or has nothing in it.
    """
    try:
        sampler = sampled_trace(trace)
    except TraceError:
        return None
    if len(sampler.time_base.time) < 2:
        return None
    line = _timeline(sampler.time_base.time, time)
    poses = sampler.poses[line.frames]
    area = _map_frame(poses[:, :2])
    robot = _robot(np.array(sampler.trace.spec.robot.footprint), buffer, area)
    there = sampler.poses[line.moment]
    grows, grown = _ways(sampler, line, area)
    ground, moving, still = [""], [grows], [grown]
    for obstacle in _obstacles(sampler, line, area, involved):
        look = style(fill=colour_value(obstacle.colour))
        drawn = f'<path d="{rings_data(obstacle.rings)}"{look}/>'
        if obstacle.track is None:
            ground.append(drawn)
            continue
        moving.append(_driven(obstacle.track[line.frames], line, area, drawn))
        still.append(_placed(obstacle.track[line.moment], area, drawn))
    moving.append(_driven(poses, line, area, robot))
    still.append(_placed(there, area, robot))
    moving += _contacts(sampler, line, area)
    moving.append(_moment_ring(area.points(there[None, :2])[0], line))
    height = area.high + _FOOT
    return MomentPicture(
        height,
        f'<g clip-path="{_CLIP}">{"".join(ground)}<g class="moving">{"".join(moving)}</g>'
        f'<g class="still">{"".join(still)}</g>{_scale_bar(area)}</g>{_foot(line, height)}',
    )


def _timeline(stamps: Floats, time: float) -> _Timeline:
    first, last = float(stamps[0]), float(stamps[-1])
    time = min(max(time, first), last)
    # Ten seconds also of a moment near the start or the end of the run.
    until = min(max(time, first + _BEFORE) + _AFTER, last)
    since = max(until - _BEFORE - _AFTER, first)
    before = np.arange(since, time, 1.0 / _RATE)
    after = np.arange(time, until, 1.0 / _RATE)
    hold, rest = int(_HOLD * _RATE), int(_REST * _RATE)
    shown = np.concatenate((before, np.full(hold, time), after, np.full(rest + 1, until)))
    frames = np.clip(np.searchsorted(stamps, shown - 1e-9), 0, len(stamps) - 1)
    pause = len(before)
    return _Timeline(frames, shown, pause, pause + hold, pause + hold + len(after))


def _map_frame(places: Floats) -> _MapFrame:
    west, south = places.min(axis=0) - _ROOM
    east, north = places.max(axis=0) + _ROOM
    wide = max(east - west, (north - south) * _ASPECT, _NARROWEST)
    high = wide / _ASPECT
    scale = _WIDTH / wide
    corner = ((west + east - wide) / 2.0, (south + north + high) / 2.0)
    return _MapFrame(scale, float(corner[0]), float(corner[1]), high * scale)


@dataclass(frozen=True, slots=True)
class _Obstacle:
    """Outlines of one colour: on the picture, or where they move around the origin of their frame,
    whose poses (n, 3) [m, rad] over the run are the ``track``.
    """

    colour: str
    rings: tuple[Floats, ...]
    track: Floats | None = None


def _obstacles(
    sampler: SignalSampler, line: _Timeline, area: _MapFrame, involved: str
) -> list[_Obstacle]:
    """Return what is on the map: what stands still in these seconds first, then what moves."""
    obstacles = sampler.obstacles
    wide, high = _WIDTH / area.scale, area.high / area.scale
    middle = (area.west + wide / 2.0, area.north - high / 2.0)
    moments = line.frames[:: int(_RATE)]
    still: dict[str, list[Floats]] = {WALL: [], SECOND: [], BAD: []}
    moving: dict[tuple[str, int], list[Floats]] = {}
    for polygon in polygons_around(obstacles, moments, middle, math.hypot(wide, high) / 2.0):
        frame = int(obstacles.frame[polygon])
        colour = SECOND if frame >= 0 else WALL
        colour = BAD if obstacles.names[polygon] == involved else colour
        first, last = obstacles.offsets[polygon : polygon + 2]
        ring = obstacles.corners[first:last]
        if frame < 0:
            still[colour].append(area.points(ring))
        elif float(np.ptp(obstacles.tracks[line.frames, frame], axis=0).max()) > _STILL:
            moving.setdefault((colour, frame), []).append(area.around(ring))
        else:
            pose = obstacles.tracks[line.moment, frame][None]
            still[colour].append(area.points(transform_points(ring, pose)))
    return [
        *(_Obstacle(colour, tuple(rings)) for colour, rings in still.items() if rings),
        *(
            _Obstacle(colour, tuple(rings), obstacles.tracks[:, frame])
            for (colour, frame), rings in moving.items()
        ),
    ]


def _robot(footprint: Floats, buffer: Point2, area: _MapFrame) -> str:
    """Return the robot around the origin, looking to the right, with its buffer."""
    hx, hy = buffer
    box = np.array([(hx, hy), (-hx, hy), (-hx, -hy), (hx, -hy)])
    ahead = np.array([(0.0, 0.0), (0.7 * float(footprint[:, 0].max()), 0.0)])
    body = style(fill=colour_value(BODY), fill_opacity="0.55", stroke=colour_value(BODY))
    return (
        f'<path d="{rings_data([area.around(box)])}"{stroke(SOFT, 0.9, dashes="4 3")}/>'
        f'<path d="{rings_data([area.around(footprint)])}"{body}/>'
        f'<path d="{path_data(area.around(ahead))}"{stroke(BODY, 2.0)}/>'
    )


def _placed(pose: Floats, area: _MapFrame, drawn: str) -> str:
    """Return what is drawn around an origin where a pose (3,) is."""
    x, y = area.points(pose[None, :2])[0]
    turned = f"rotate({number(-math.degrees(pose[2]))})"
    return f'<g transform="translate({number(x)} {number(y)}) {turned}">{drawn}</g>'


def _driven(poses: Floats, line: _Timeline, area: _MapFrame, drawn: str) -> str:
    """Return what is drawn around an origin as it moves along the poses (frames, 3)."""
    places = [f"{number(x)} {number(y)}" for x, y in area.points(poses[:, :2]).tolist()]
    # Unwrapped: from 179 to -179 degrees it is two degrees, not once around.
    turns = [number(-angle) for angle in np.degrees(np.unwrap(poses[:, 2])).tolist()]
    turned = _transformed("rotate", turns, line, drawn)
    return _transformed("translate", places, line, turned)


def _transformed(kind: str, values: Sequence[str], line: _Timeline, drawn: str) -> str:
    if len(set(values)) == 1:  # as the place of a hinge
        return f'<g transform="{kind}({values[0]})">{drawn}</g>'
    return (
        f'<g><animateTransform attributeName="transform" type="{kind}" '
        f'values="{";".join(values)}" {line.repeated}/>{drawn}</g>'
    )


def _animate(
    name: str, steps: Sequence[tuple[str, str]], line: _Timeline, *, leaping: bool = True
) -> str:
    """Return an animation of an attribute: values and when (0 to 1) each begins, the first at 0."""
    values, times = zip(*steps, strict=True)
    mode = ' calcMode="discrete"' if leaping else ""
    return (
        f'<animate attributeName="{name}" values="{";".join(values)}" '
        f'keyTimes="{";".join(times)}"{mode} {line.repeated}/>'
    )


def _shown(since: float, until: float, line: _Timeline) -> str:
    """Return the animation of what is there from one frame until another only."""
    steps = [("hidden", "0")] if since > 0 else []
    steps += [("visible", line.share(since))]
    steps += [("hidden", line.share(until))] if until < line.last else []
    return _animate("visibility", steps, line)


def _ways(sampler: SignalSampler, line: _Timeline, area: _MapFrame) -> tuple[str, str]:
    """Return the way that grows while the robot drives, and as it is at the moment."""
    first, last = int(line.frames[0]), int(line.frames[-1])
    points = area.points(sampler.poses[first : last + 1, :2])
    gone = np.concatenate(([0.0], np.cumsum(np.hypot(*np.diff(points, axis=0).T))))
    look = stroke(LINE, 1.2)
    still = path_data(points[: line.moment - first + 1])
    if gone[-1] < 1.0:
        return "", path_element(still, look)
    rest = [_dash_offset(gone[-1] - gone[frame - first]) for frame in line.frames.tolist()]
    grows = (
        f'<animate attributeName="stroke-dashoffset" values="{";".join(rest)}" {line.repeated}/>'
    )
    moving = f'<path d="{path_data(points)}" {_undrawn(gone[-1])}{look}>{grows}</path>'
    return moving, path_element(still, look)


def _undrawn(length: float) -> str:
    """Return the attributes of a line of which nothing is seen until its offset gets smaller."""
    offset = _dash_offset(length)
    return f'stroke-dasharray="{offset}" stroke-dashoffset="{offset}"'


def _dash_offset(left: float) -> str:
    """Return the offset at which so much [points] of an undrawn line is left to be seen.

    The dash is a point longer than the line: rounded, its next one would begin at the line's end.
    """
    return number(left + 1.0)


def _contacts(sampler: SignalSampler, line: _Timeline, area: _MapFrame) -> Iterator[str]:
    """Return a flash for every contact of the robot, one for each second and place."""
    since, until = line.times[0], line.times[-1]
    seen: set[tuple[int, int, int]] = set()
    for record in sampler.trace.contacts:
        if not since <= record.time <= until or "robot" not in (record.first, record.second):
            continue
        x, y = area.points(np.array([record.point[:2]]))[0].tolist()
        key = (int(record.time / _FLASH), round(x / 6.0), round(y / 6.0))
        if key in seen:
            continue
        seen.add(key)
        frame = line.frame_at(record.time)
        yield (
            f'<circle cx="{number(x)}" cy="{number(y)}" r="7" visibility="hidden"'
            f"{stroke(BAD, 2.2)}>{_shown(frame, frame + _FLASH * _RATE, line)}</circle>"
        )


def _moment_ring(place: Floats, line: _Timeline) -> str:
    """Return a ring that closes in on the robot while the picture stands still at the moment."""
    begin, end = line.share(line.pause), line.share(line.resume)
    wide = [("26", "0"), ("26", begin), ("12", end), ("12", "1")]
    return (
        f'<circle cx="{number(place[0])}" cy="{number(place[1])}" r="18" visibility="hidden"'
        f"{stroke(BAD, 1.6)}>{_animate('r', wide, line, leaping=False)}"
        f"{_shown(line.pause, line.resume, line)}</circle>"
    )


def _foot(line: _Timeline, height: float) -> str:
    """Return what is below the map: how far it is, with the moment marked, and the time."""
    left, right, y = 2.0, _WIDTH - 46.0, height - _FOOT / 2.0 + 1.0
    span = float(line.times[-1] - line.times[0]) or 1.0
    at = left + (right - left) * float(line.times[line.pause] - line.times[0]) / span
    rail, done = (
        f'<path d="M{number(left)} {number(y)} {number(end)} {number(y)}"' for end in (right, at)
    )
    rest = _dash_offset(right - at)
    steps = [(_dash_offset(right - left), "0"), (rest, line.share(line.pause))]
    steps += [(rest, line.share(line.resume))]
    steps += [(_dash_offset(0.0), line.share(line.arrival)), (_dash_offset(0.0), "1")]
    whole = (
        f"{rail} {_undrawn(right - left)}{stroke(LINE, 2.0)}>"
        f"{_animate('stroke-dashoffset', steps, line, leaping=False)}</path>"
    )
    mark = f"M{number(at)} {number(y - 4.0)} {number(at)} {number(y + 4.0)}"
    return (
        f"{rail}{stroke(RULE, 2.0)}/>"
        f'<g class="moving">{whole}{"".join(_times(line, y))}</g>'
        f'<g class="still">{done}{stroke(LINE, 2.0)}/>{_time_text(line.times[line.pause], y)}</g>'
        f'<path d="{mark}"{stroke(BAD, 1.6)}/>'
    )


def _times(line: _Timeline, y: float) -> Iterator[str]:
    """Return the time of the run, a text for every half second, each shown in its turn."""
    step = int(_LABEL * _RATE)
    starts = [*range(0, line.pause, step), line.pause, *range(line.resume, line.last, step)]
    for begin, end in itertools.pairwise([*starts, line.last + 1]):
        words = _time_text(float(line.times[begin]), y)
        yield f'<g visibility="hidden">{_shown(begin, end, line)}{words}</g>'


def _time_text(time: float, y: float) -> str:
    return text_element(_WIDTH - 2.0, y + 3.0, f"{time:.1f} s", 8.5, INK, anchor="end")


def _scale_bar(area: _MapFrame) -> str:
    length = 1.0 if _WIDTH / area.scale < 15.0 else 5.0
    y, end = area.high - 5.0, 5.0 + length * area.scale
    words = text_element(5.0, y - 3.0, f"{length:g} m", 7.0, INK, halo=True)
    return f'<path d="M5 {number(y)} {number(end)} {number(y)}"{stroke(INK, 1.6)}/>{words}'
