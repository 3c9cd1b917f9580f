"""A picture of a world for people: plan, doors at their angles, waypoints, the robot, its ways.

One drawing, as a file (SVG, PNG, PDF) or within a page, whose style sheet colours it.
"""

from templates.picture._compose import draw_world
from templates.picture._drawing import Drawing
from templates.picture._files import PNG_SCALE, page_svg, picture_svg, write_drawing, write_picture
from templates.picture._page import LARGE, MOMENT, SMALL
from templates.picture._run import DrivenWay, RunOverlay

__all__ = [
    "LARGE",
    "MOMENT",
    "PNG_SCALE",
    "SMALL",
    "Drawing",
    "DrivenWay",
    "RunOverlay",
    "draw_world",
    "page_svg",
    "picture_svg",
    "write_drawing",
    "write_picture",
]
