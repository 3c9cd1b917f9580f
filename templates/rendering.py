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
# Endings of templates whose values are escaped.
_XML: Final = (".sdf.j2", ".world.j2", ".config.j2", ".svg.j2", ".launch.j2", ".xml.j2")


def render(template: str, /, **values: Any) -> str:
    """Return ``template`` filled with ``values``, which are escaped in XML."""
    return _environment().get_template(template).render(values)


@functools.cache
def _environment() -> jinja2.Environment:
    environment = strict_environment(
        jinja2.FileSystemLoader(BUILT_IN),
        autoescape=lambda name: bool(name and name.endswith(_XML)),
        keep_trailing_newline=True,
    )
    as_json = functools.partial(json.dumps, ensure_ascii=False, allow_nan=False)
    environment.filters.update(number=number, numbers=numbers, json=as_json)
    return environment


def strict_environment(loader: jinja2.BaseLoader, **options: Any) -> jinja2.Environment:
    """Return an environment that raises errors for missing names and makes texts fit for XML."""
    return jinja2.Environment(
        loader=loader,
        undefined=jinja2.StrictUndefined,
        # Only plain strings: markup marked as safe was made here and stays as it is.
        finalize=lambda value: xml_text(value) if type(value) is str else value,
        trim_blocks=True,
        lstrip_blocks=True,
        **options,
    )


def number(value: float, digits: int = 9) -> str:
    """Return ``value`` in plain decimals, rounded to ``digits``; no exponent, no ``-0``.

    Raises :class:`ValueError` for infinite numbers and NaN, which these file formats lack.
    """
    if not math.isfinite(value):
        raise ValueError(f"a file cannot contain the number {value}")
    text = f"{value:.{digits}f}"
    text = text.rstrip("0").rstrip(".") if "." in text else text
    return "0" if text == "-0" else text


def numbers(values: Any, digits: int = 9) -> str:
    """Return numbers separated by blanks."""
    return " ".join(number(value, digits) for value in values)
