"""Plans for tests of variations, and a short way to vary them."""

from grammars.variation import parse_variation, sample

HOUSE = """\
// A house.   "with // quotes"
Floor plan: house
    Defaults:
        walls:
            thickness: 0.2 m            // for everyone
            height: 2.5 m

    var reach = -1.5 m // metres
    var turn = 30.0 deg
    var gap
        = 0.9 m

    Space hall:
        shape: Rectangle width=6 m, length=4.0 m
        location:
            wrt: world // the anchor
            of: this
            translation: x: 0 m
            rotation: z: 0 deg
        walls: thickness: 0.2 m
        features:
            Column pillar:
                shape: Circle radius=0.2 m
                height: 2.5
                location:
                    wrt: this.walls[1]
                    translation: y: -1.0 m
            Divider screen:
                shape: Rectangle width=gap, length=0.1 m
                height: 1 m
                location: wrt: this rotation: z: turn translation: x: - reach, y: 1 m

    Space room: // next to the hall
        shape: Rectangle width=3.0 m, length=gap
        location:
            wrt: hall.walls[1]
            of: this.walls[3]
            translation: x: 0.25 m
            spaced
        walls:
            thickness: 0.3 m

    Space closet: shape: Polygon points: [(0, 0), (0, 1), (gap, 1), (gap, 0)] location: spaced
        wrt: hall.walls[3] of: this.walls[1] walls: features: Column post:
            shape: Rectangle width=0.1, length=0.1 height: 2
            location: wrt: this translation: x: 0.4, y: 0.4

    Entryway door: shape: Rectangle width=gap, height=2 m location: in: hall.walls[1] and room.walls[3]

    Window pane:
        shape: Rectangle width=1 m, height=1 m
        location:
            in: hall.walls[0] // to the garden
            translation: z: 1.5 m, x: 0 m
            rotation: y:
              0 rad
"""  # noqa: E501


def vary(folder, statements, plan=HOUSE, **options):
    """Return the variation of ``plan`` by ``statements``."""
    (folder / "plan.fpm").write_bytes(plan.encode())
    text = f'import "plan.fpm"\n{statements}'
    return parse_variation(text, "test.variation", folder, **options)


def one(folder, statements, plan=HOUSE, **options):
    """Return the variant of seed 7."""
    return sample(vary(folder, statements, plan, **options), 1, seed=7)[0]


def numbers(variant):
    """Return the values of a variant by their names."""
    return {value.name: value.number for value in variant.values}
