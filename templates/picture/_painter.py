"""Paints one SVG as PNG: also a program of its own, which imports nothing but resvg."""

import importlib
import json
import sys
from pathlib import Path


def paint(order: Path) -> None:
    """Paint what a JSON file says: ``arguments`` of ``resvg_py.svg_to_bytes``, and the ``path``."""
    told = json.loads(order.read_text(encoding="utf-8"))
    image = importlib.import_module("resvg_py").svg_to_bytes(**told["arguments"])
    Path(told["path"]).write_bytes(image)


if __name__ == "__main__":
    paint(Path(sys.argv[1]))
