"""The map as a picture in the terminal, by choice: kitty's graphics or sixel.

The dashboard gives the terminal back for as long as it is looked at: what is drawn in between would
be cells again. Here is what takes a while to load.
"""

from __future__ import annotations

import sys
import tempfile
from pathlib import Path
from typing import Any, Final

from rich.console import Console
from textual.app import App, SuspendNotSupported

from grammars.text.diagnostics import InputError
from grammars.text.extras import load_extra
from grammars.text.words import count_noun
from scenario_tui.dashboard.base_app import BaseDashboard
from scenario_tui.dashboard.config import Config, config_path, read_config
from scenario_tui.dashboard.config_file import Pictures
from scenario_tui.dashboard.widgets.map_frame import View
from scenario_tui.dashboard.widgets.top_view import TopView
from templates.plan_shapes import ShapeRole, footprint_shape, trail_shapes
from templates.world import ArtefactWorld

_PURPOSE: Final = ("pictures", "a picture in the terminal", "dashboard")
_BELOW: Final = 2
"""Lines that are left below a picture."""


def paint_view(view: View, path: Path) -> Path:
    """Write the picture of a view as PNG, and return the path.

    Raises :class:`grammars.text.extras.MissingExtraError` without the extra ``pictures``.
    """
    from templates.picture import RunOverlay, draw_world, write_png

    close = tuple(
        tuple((float(x), float(y)) for x, y in part)
        for shape in trail_shapes(view.trail, view.clearances, view.limit)
        if shape.role is not ShapeRole.TRAIL
        for part in shape.parts
    )
    stops = count_noun(len(view.mission.waypoints), "waypoint")
    (body,) = footprint_shape(view.where, view.robot).parts
    overlay = RunOverlay(
        view.trail,
        close=close,
        contacts=view.contacts,
        about=f"{view.robot.name}  ·  reached {view.reached} of {stops}",
        footprints=(tuple((float(x), float(y)) for x, y in body),),
        positions=dict(zip(view.scene.joint_names, view.joints, strict=True)),
    )
    world = ArtefactWorld(
        name=view.scene.name, scene=view.scene, mission=view.mission, robot=view.robot
    )
    return write_png(draw_world(world, overlay), path)


def print_picture(path: Path, wanted: Pictures, console: Console) -> str:
    """Print a picture as large as the console; return why not, or nothing.

    ``auto`` asks the terminal, which nobody else may listen to meanwhile. Raises
    :class:`grammars.text.extras.MissingExtraError` without the extra ``pictures``.
    """
    images: Any = load_extra("textual_image.renderable", *_PURPOSE)
    known = {"kitty": images.TGPImage, "sixel": images.SixelImage}
    kind = known.get(wanted, images.Image)
    if kind not in known.values():
        return (
            "this terminal does not say that it shows pictures (kitty's graphics or sixel); inside "
            "of tmux none does"
        )
    room = max(console.size.height - _BELOW, 1)
    console.print(kind(path, width="auto", height="auto"), height=room)
    return ""


def look_at_picture(top: TopView) -> None:
    """Show what is on a map as a picture until Enter is pressed, or say why not."""
    app = top.app
    try:
        config = app.config if isinstance(app, BaseDashboard) else read_config()
        why = _why_not(top, config) or _show(app, top, config.pictures)
    except InputError as error:
        said = (f"{d.message}; {d.hint}" if d.hint else d.message for d in error.diagnostics)
        why = "; ".join(said)
    except (SuspendNotSupported, EOFError):
        why = "this terminal cannot be given back"
    if why:
        top.notify(why, severity="warning", markup=False)


def _why_not(top: TopView, config: Config) -> str:
    if config.pictures == "off":
        where = config.path or config_path()
        return f'pictures are off: write pictures = "auto" below [dashboard] in {where}'
    return "" if top.view is not None else "there is nothing to be seen yet"


def _show(app: App[Any], top: TopView, wanted: Pictures) -> str:
    with tempfile.TemporaryDirectory() as folder:
        assert top.view is not None
        path = paint_view(top.view, Path(folder) / "map.png")
        with app.suspend():
            console = Console(file=sys.__stdout__, highlight=False)
            why = print_picture(path, wanted, console)
            if not why:
                console.input("\nEnter goes back ")
            return why
