"""Variation language: families of floor plans, drawn from distributions, that still make sense.

A ``.variation`` file imports one plan and says what differs between its variants::

    import "kitchen.fpm"

    let wide = uniform(0.8 m .. 1.4 m)               // one draw, used wherever it is named

    ceiling: uniform([2.4, 2.7, 3.0])                // a variable of the plan, one of a list
    corridor: {
        shape.width: discrete([(0.8, 2.0), (0.2, 4.0)])          // (probability, value)
        defaults.wall.thickness: uniform(0.1 .. 0.3)             // anything in between
    }
    hall.pillar: { location.translation.x: normal(mean=1.0, std=0.3, min=0.2, max=1.8) }
    door: { shape.width: wide }
    gate: { shape.width: 2 * wide + 0.1 m }          // as wide as two doors and a post

    require corridor.area >= 12 m^2                  // draw again until all of these hold
    require distance(hall.pillar, door) > 0.8 m

Spaces and openings are addressed by their names, features by ``space.feature``, variables of the
plan by their names alone. Numbers without a unit are in the unit of the plan's text. In a
``require`` stand numbers, named draws, variables, attributes (``door.shape.width``) and measures:
``area``, ``perimeter``, ``thickness`` and ``height`` of a space, ``width``, ``height``, ``depth``
and ``sill`` of an opening, ``height`` of a feature, ``distance(a, b)`` between two elements; with
``+ - * /``, ``abs``, ``min``, ``max``, comparisons, ``and``, ``or`` and ``not``.

Comments and layout of the plan survive in its variants: sampled numbers replace those in its
text. What a plan does not write is not varied.
"""

from grammars.variation._distributions import Categorical, Fixed, Normal, Range
from grammars.variation._fixed import draw_unit, fix_draws
from grammars.variation._load import (
    Variant,
    VariantValue,
    Variation,
    load_variation,
    parse_variation,
)
from grammars.variation._sample import sample, source_defects, variant_plans
from grammars.variation._variants import VariantFile, WrittenVariants, write_variants
from grammars.variation.designs import METHODS, Method

__all__ = [
    "METHODS",
    "Categorical",
    "Fixed",
    "Method",
    "Normal",
    "Range",
    "Variant",
    "VariantFile",
    "VariantValue",
    "Variation",
    "WrittenVariants",
    "draw_unit",
    "fix_draws",
    "load_variation",
    "parse_variation",
    "sample",
    "source_defects",
    "variant_plans",
    "write_variants",
]
