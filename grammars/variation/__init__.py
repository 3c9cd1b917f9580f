"""Variation language: families of sound floor plans, drawn from distributions.

A ``.variation`` file imports one plan and describes the differences between its variants::

    import "kitchen.fpm"

    let wide = uniform(0.8 m .. 1.4 m)               // one draw, used by name

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

Spaces, openings and variables are addressed by name, features by ``space.feature``. Numbers without
a unit are in the unit of the plan's text. A ``require`` has numbers, named draws, variables,
attributes (``door.shape.width``) and measures: ``area``, ``perimeter``, ``thickness`` and
``height`` of a space, ``width``, ``height``, ``depth`` and ``sill`` of an opening, ``height`` of a
feature, ``distance(a, b)`` between two elements; with ``+ - * /``, ``abs``, ``min``, ``max``,
comparisons, ``and``, ``or`` and ``not``.

Sampled numbers replace those in the text of the plan, so that comments and layout stay. Only
attributes written in the plan can vary.
"""

from grammars.variation._distributions import Fixed
from grammars.variation._load import (
    Variation,
    draw_unit,
    fix_draws,
    load_variation,
    parse_variation,
)
from grammars.variation._sample import sample, source_defects
from grammars.variation._variants import VariantFile, WrittenVariants, write_variants
