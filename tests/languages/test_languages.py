"""Facts of all languages: they read the same units, and whichever thread comes first loads them."""

from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from threading import Barrier

import pytest

import grammars
from grammars.floorplan import read_floorplan
from grammars.oracle import parse_oracle
from grammars.scenery import parse_scenery
from grammars.text.diagnostics import InputError, Where
from grammars.text.expression_check import read_predicate
from grammars.text.parsing import load_metamodel
from grammars.text.quantity import read_quantity
from grammars.text.units import SI_UNITS, UNIT_WORDS, read_unit
from grammars.variation import parse_variation

SPELLED = ("N m", "N*m/rad", "m/s^2", "m / s", "°/s", "m²", "deg/deg^0.5", "kN m s/rad", "cm/min")
UNITS = [*UNIT_WORDS, *SPELLED, *(unit for unit in SI_UNITS.values() if unit != "1")]

PLAN = """\
Floor plan: flat
Defaults: walls: thickness: 0.1 m height: 2.5 m
var depth = 3 {unit}
Space hall:
    shape: Rectangle width=4 m, length=4 m
    location: wrt: world of: this
"""


def yaml(unit, folder):
    return read_quantity(f"3 {unit}").value


def scenery(unit, folder):
    (parameter,) = parse_scenery(f"parameter p = 3 {unit}", "d.scenery").parameters
    return parameter.value.value


def oracle(unit, folder):
    # Blanks around a slash would divide by a signal.
    spelled = f"3 {unit.replace(' / ', '/')}"
    judgement = parse_oracle("o", f"always({spelled} >= {spelled})", Where("o.yaml")).judgement
    return judgement.predicate.left.value


def floorplan(unit, folder):
    plan = folder / "plan.fpm"
    plan.write_text(PLAN.replace("{unit}", unit), "utf-8")
    (variable,) = read_floorplan(plan).variables
    return variable.value


def variation(unit, folder):
    (folder / "flat.fpm").write_text(PLAN.replace("{unit}", "m"), "utf-8")
    text = f'import "flat.fpm"\nrequire 3 {unit} > 0\ndepth: uniform([3.0])\n'
    (required,) = parse_variation(text, "flat.variation", folder).requirements
    return required.predicate.left.value


def expression(unit, folder):
    # Blanks around a slash would divide by a value.
    spelled = f"3 {unit.replace(' / ', '/')}"
    units = {"x": read_quantity(f"3 {unit}").unit.removeprefix("1")}
    return read_predicate(f"x >= {spelled}", units, Where("c.yaml")).right.value


LANGUAGES = (yaml, scenery, oracle, floorplan, variation, expression)


@pytest.mark.parametrize("read", LANGUAGES)
def test_every_language_reads_every_unit_and_no_other(read, tmp_path):
    for unit in dict.fromkeys(UNITS):
        factor, _ = read_unit(" ".join(unit.split()))
        assert read(unit, tmp_path) == pytest.approx(3 * factor, rel=1e-14), unit
    for unit in ("furlong", "degs", "kmin", "m^9", "feet", "Ns"):
        with pytest.raises((InputError, ValueError)):
            read(unit, tmp_path)


GRAMMARS = sorted(Path(grammars.__path__[0]).glob("*/*.tx"))


def test_languages_are_loaded_by_several_threads_at_once():
    assert len(GRAMMARS) == 6
    together = Barrier(len(GRAMMARS))

    def load(grammar):
        together.wait(60.0)
        return str(load_metamodel(grammar).rootcls.__name__)

    with ThreadPoolExecutor(len(GRAMMARS)) as threads:
        names = list(threads.map(load, GRAMMARS))
    assert len(set(names)) == len(GRAMMARS)
