"""Jinja templates of the artefacts."""

from __future__ import annotations

import functools
import json
import math
from pathlib import Path
from typing import Any, Final

import jinja2

from templates.naming import xml_text

BUILT_IN: Final = Path(__file__).parent / "files"
# Endings of templates into which everything is put escaped.
_XML: Final = (".sdf.j2", ".world.j2", ".config.j2", ".svg.j2", ".launch.j2", ".xml.j2")


def render(template: str, /, **values: Any) -> str:
    """Return ``template`` filled with ``values``; everything put into XML is escaped."""
    return _environment().get_template(template).render(values)


@functools.cache
def _environment() -> jinja2.Environment:
    environment = strict_environment(
        jinja2.FileSystemLoader(BUILT_IN),
        autoescape=lambda name: bool(name and name.endswith(_XML)),
        keep_trailing_newline=True,
    )
    environment.filters.update(number=number, numbers=numbers, json=_json)
    return environment


def strict_environment(loader: jinja2.BaseLoader, **options: Any) -> jinja2.Environment:
    """Return an environment in which missing names are errors and texts are fit for XML."""
    return jinja2.Environment(
        loader=loader,
        undefined=jinja2.StrictUndefined,
        # Plain strings only: what is marked as safe was made here and stays as it is.
        finalize=lambda value: xml_text(value) if type(value) is str else value,
        trim_blocks=True,
        lstrip_blocks=True,
        **options,
    )


def number(value: float, digits: int = 9) -> str:
    """Return ``value`` in plain decimals, rounded to ``digits``; no exponent, no ``-0``.

    Raises :class:`ValueError` for what is not finite: no file format here can hold it.
    """
    if not math.isfinite(value):
        raise ValueError(f"{value} is no number a file can hold")
    text = f"{value:.{digits}f}"
    text = text.rstrip("0").rstrip(".") if "." in text else text
    return "0" if text == "-0" else text


def numbers(values: Any, digits: int = 9) -> str:
    """Return numbers separated by blanks."""
    return " ".join(number(value, digits) for value in values)


def _json(value: Any) -> str:
    return json.dumps(value, ensure_ascii=False, allow_nan=False)
