"""Scenery language: objects with joints, their places in a floor plan, and their behaviours.

A ``.scenery`` file is one layer. Layers refer to each other by name and are combined by
:mod:`grammars.scenery.composition`; no layer needs an edit for another one. Line breaks have no
meaning, comments start with ``//``, every quantity has a unit.

Object models have their own frame; geometry is given with all joints at zero::

    object hinged_door
        link post  box 5 cm x 5 cm                   from 0 m to 2 m,    mass 50 kg
        link leaf  box 5 cm x 90 cm at (0 m, 48 cm)  from 1 cm to 2 m,   mass 20 kg
        joint hinge  revolute from post to leaf at (-2.5 cm, 2.5 cm), between 0 deg and 110 deg,
            friction 0.5 N m, closer 2 N m/rad damped by 1 N m s/rad to 0 deg
        state closed: hinge 0 deg
        state open:   hinge 95 deg

Shapes are ``box``, ``circle radius 3 cm`` and convex ``polygon (0 m, 0 m), …``; ``and`` joins
several shapes, a box may be ``turned``. Links without joints stand still. A ``prismatic`` joint
goes ``along x``, ``along -y`` or ``along 30 deg``. A ``fixed`` joint connects two links rigidly (in
the scene it is a joint with both limits 0). Furniture has only fixed joints::

    object table
        link top   box 1.2 m x 80 cm      from 70 cm to 74 cm,  mass 20 kg
        link foot  cylinder radius 20 cm  from 0 m to 70 cm,    mass 10 kg
        joint glue fixed from top to foot
    table_1 is a table in kitchen, x 1 m, y 0.5 m, turned 30 deg
    table_2 is a table at hall.walls[0], y -60 cm

Instances stand in any frame of the floor plan or are fitted into an entryway. Left, right, inwards
and inside are seen from the room of the entryway's first wall, facing the wall, unless another room
is named::

    front_door   is a hinged_door at hall.walls[1], x 1.2 m, y 10 cm, turned 90 deg, starts open
    kitchen_door is a hinged_door in kitchen_doorway, hinge left, opening into kitchen
    store_door   is a sliding_door in store_doorway, sliding right, on the side of store, frozen

Behaviours apply to named objects or to all objects of a group or model; positions are states or
quantities. The last layer about a joint wins::

    group rooms: kitchen_door, store_door
    parameter near = 1.3 m

    every hinged_door except kitchen_door stays closed
    store_door moves to open at 5 s, to closed at 1 min, by servo at 0.4 m/s with 60 N
    all rooms toggle between closed and open every 30 s from 90 s until 12 min,
        with probability 0.5, up to 10 s late in steps of 1 s, by jump
    kitchen_door goes from open to closed when the robot is within near of its hinge,
        again beyond 2 m, by spring of 0.5 N m/rad damped by 0.1 N m s/rad
    cabinet_door toggles between closed and open after uniform 10 s to 40 s, from 1 min

The distance is measured from the ``hinge``, the ``foot`` of the object (the origin of its frame),
the ``leaf`` or the ``doorway`` to the robot's base, or to ``the robot's footprint``. ``starting at
closed`` sets another start position. Without ``by``, joints move as a servo with the defaults of
:class:`grammars.model.behaviour.Servo`; without ``from``, the first draw comes after one period.
The time between two changes may also be random: ``uniform 10 s to 40 s``, ``exponential with mean
20 s`` or ``normal with mean 20 s, deviation 5 s``. ``front_door starts open`` and ``front_door is
frozen`` in another layer change the start of an object.

Reactions happen once: when a leg of the mission begins (leg 1 leads to the first waypoint), when a
waypoint is reached, when another object ``fires`` (its trigger or reaction) or ``starts to move``
(by 1 cm or 0.01 rad, for any reason)::

    front_door   goes from closed to open when leg 2 begins, after 2 s
    bedroom_door goes from open to closed when waypoint living-room is reached, by jump
    garden_door  goes from open to closed when front_door fires, after 500 ms

A ``mover`` is a walking object: one link carries all others. It collides only with the robot, which
it pushes aside; it cannot be pushed and stops only if the robot cannot move away::

    mover person
        link body  circle radius 25 cm  from 0 m to 1.75 m,  mass 75 kg
    visitor is a person in hall, x 1 m
    guest   is a person at hall
    child   is a person at kitchen

    visitor walks along (1 m, 0 m), (5 m, 0 m) of hall, at 0.8 m/s, back and forth, pausing 2 s,
        yielding within 1 m
    guest walks along (0 m, 0 m) of hall, (0.5 m, 1 m) of kitchen, when visitor starts to move,
        after 3 s
    child walks along (0 m, 0 m), (2 m, 0 m), (2 m, 1 m) of kitchen, round, accelerating at 2 m/s^2,
        pausing 1 s at every point, facing 90 deg, from 10 s, not yielding

Points are in the frame named next, otherwise in the world. Walks are ``once`` (the default),
``back and forth`` or ``round``; by default at 1 m/s, with 1 m/s^2, without pause, not yielding. A
mover faces ``ahead``, ``sideways`` (its right hand in the first direction) or a fixed direction in
the frame of the last point. A yielding mover brakes while the robot is ahead within the distance.
See :class:`grammars.model.behaviour.Walk`.
"""

from grammars.scenery._layer import load_scenery, parse_scenery
from grammars.scenery._parameters import configure, unused_groups, unused_parameters
from grammars.scenery.model import SceneryLayer

__all__ = [
    "SceneryLayer",
    "configure",
    "load_scenery",
    "parse_scenery",
    "unused_groups",
    "unused_parameters",
]
