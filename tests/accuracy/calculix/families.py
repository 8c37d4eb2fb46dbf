"""The scenes of scenes.py: which bodies touch the skin where, how deep and under what pressure.

Depths are from the inflated wall; `Scene.bodies` turns them into depths from the unloaded one. Every third scene of a family is held out.
"""

import math
import random

from touch import OUTER, Band, Body, Hill, arc, disc, finger, plate, sphere

INFLATED_KPA = (0.1, 0.2, 0.3, 0.35, 0.5, 0.7, 0.8, 0.85, 0.9, 1.0, 1.05, 1.2, 1.3, 1.5)
FULL = (0.0, 0.3, 0.5, 1.0, 1.5)
TURN = 2 * math.pi


class Scene:
    """makers: (function, angle, z, depth or a hill's peak, ...) of each body."""

    def __init__(self, makers, pressure, baseline=0.0):
        self.makers, self.pressure, self.baseline = makers, pressure, baseline
        self.family = self.name = self.held_out = None

    def bodies(self, grown, share):
        """grown: z -> radial growth of the inflated outer wall; share: of the depths that are asked for."""
        return [maker(angle, z, depth * share - (0 if maker is hill else grown(z)), *more) for maker, angle, z, depth, *more in self.makers]

    def key(self):
        return repr([(m[0].__name__, *m[1:]) for m in self.makers] + [self.pressure])


def hill(angle, z, peak, half_a, half_b):
    return Hill(angle, z, peak, half_a, half_b)


def glued(angle, z, depth, diameter, around, along):
    return disc(angle, z, depth, diameter, drag=(around, along))


def bar(angle, z, depth, around, along):
    return plate(angle, z, depth, around, along, "bar")


def edge(angle, z, depth, around, along):
    return plate(angle, z, depth, around, along, "edge")


def band(angle, z, depth, half_angle, half_b):
    return Band(angle, z, depth, half_angle, half_b)


def palm(angle, z, depth, diameter):
    half = diameter / 2
    return Body("palm", angle, z, depth, half, half)


def small(dice, angle, z, deep=(2.0, 9.0)):
    """One disc, sphere or finger."""
    depth, pick = dice.uniform(*deep), dice.random()
    if pick < 0.45:
        return disc, angle, z, depth, dice.uniform(5, 20)
    if pick < 0.75:
        return sphere, angle, z, depth, dice.uniform(6, 20)
    return finger, angle, z, depth, dice.uniform(5, 9), dice.uniform(12, 30), dice.random() < 0.4


def place(dice, low=30.0, high=168.0):
    return dice.uniform(0, TURN), dice.uniform(low, high)


def singles(dice, count):
    for n in range(count):
        if n % 12 == 11:
            yield Scene([(hill, *place(dice), dice.uniform(2e-3, 4e-3), dice.uniform(8, 16), dice.uniform(8, 16))], FULL[1 + n % 4])
        else:
            yield Scene([small(dice, *place(dice))], FULL[n % 5])


def far(angle, z, others):
    return all(math.hypot(arc(angle - a) * OUTER, z - at) > 62 for _, a, at, *_ in others)


def several(dice, count):
    for n in range(count):
        bodies = []
        while len(bodies) < 2 + n % 2:
            angle, z = place(dice)
            if far(angle, z, bodies):
                bodies.append(small(dice, angle, z))
        yield Scene(bodies, FULL[n % 5])


def neighbors(dice, count):
    """Two bodies on one path or one ring, 36 to 72 mm apart."""
    for n in range(count):
        apart, angle = dice.uniform(36, 72), dice.uniform(0, TURN)
        z = dice.uniform(30, 168 - apart)
        other = (angle, z + apart) if n % 2 == 0 else (angle + apart / OUTER, z)
        depths = [dice.uniform(3, 8) for _ in range(2)]
        yield Scene([(disc, angle, z, depths[0], dice.uniform(6, 16)), (disc, *other, depths[1], dice.uniform(6, 16))], FULL[n % 5])


def clamps(dice, count):
    for n in range(count):
        z = dice.uniform(12, 24) if n % 2 else dice.uniform(174, 186)
        yield Scene([small(dice, dice.uniform(0, TURN), z, (1.5, 5.0))], FULL[n % 5])


def six(dice, even):
    angle, z, wide, deep = dice.uniform(0, TURN), dice.uniform(60, 138), dice.uniform(9, 16), dice.uniform(2.5, 5)
    return [(disc, angle + TURN * n / 6, z, deep if even else deep * dice.uniform(0.4, 1.4), wide) for n in range(6)]


def squeeze(dice, kind):
    """One scene of loads that go around."""
    angle, z = dice.uniform(0, TURN), dice.uniform(60, 138)
    if kind in ("even", "uneven"):
        return six(dice, kind == "even")
    if kind == "arc":
        return [(band, angle, z, dice.uniform(2, 5), dice.uniform(0.5, 1.5), dice.uniform(6, 10))]
    if kind == "hug":
        return [(band, angle, z, dice.uniform(1.0, 2.5), math.pi, dice.uniform(8, 16))]
    if kind == "hug270":
        return [(band, angle, z, dice.uniform(1.5, 3), 0.75 * math.pi, dice.uniform(8, 14))]
    around = {"hill": None, "hill270": 0.75 * math.pi * OUTER, "hillarc": dice.uniform(40, 75)}[kind]
    return [(hill, angle, z, dice.uniform(0.5e-3, 1.0e-3) if around is None else dice.uniform(0.8e-3, 1.4e-3), around, dice.uniform(18, 30))]


SQUEEZES = (("even", 0.0), ("uneven", 0.5), ("hug", 1.0), ("hillarc", 1.0), ("uneven", 1.0), ("arc", 0.5), ("hill", 1.5), ("even", 1.0),
            ("hug270", 1.5), ("arc", 1.0), ("uneven", 0.0), ("hill270", 1.0), ("hug", 0.5), ("even", 1.5), ("uneven", 1.5), ("hill", 0.5))


def squeezes(dice, count):
    for kind, pressure in SQUEEZES[:count]:
        yield Scene(squeeze(dice, kind), pressure)


def hand(dice):
    """Four fingertips on one side, the palm on the other."""
    angle, z, pitch = dice.uniform(0, TURN), dice.uniform(90, 108), dice.uniform(20, 24)
    tips = [(disc, angle + math.pi + dice.uniform(-0.15, 0.15), z + (n - 1.5) * pitch, dice.uniform(3, 7), 16.0) for n in range(4)]
    return [*tips, (palm, angle, z, dice.uniform(3, 5), 40.0)]


def hands(dice, count):
    for n in range(count):
        yield Scene(hand(dice), (0.5, 1.0, 0.0, 1.5, 0.3)[n % 5])


def wide(dice, number):
    """A plate, a bar along the axis, or an edge either way."""
    angle, z = place(dice, 80, 118)
    kind = number % 4
    if kind == 0:
        return plate, angle, z, dice.uniform(3, 6), dice.uniform(40, 70), dice.uniform(30, 60)
    if kind == 1:
        return bar, angle, z, dice.uniform(3, 6), dice.uniform(6, 12), dice.uniform(60, 120)
    if kind == 2:
        return edge, angle, z, dice.uniform(3, 8), dice.uniform(24, 50), 4.0
    return edge, angle, z, dice.uniform(3, 8), 4.0, dice.uniform(30, 60)


def plates(dice, count):
    for n in range(count):
        yield Scene([wide(dice, n)], FULL[(n + n // 5) % 5])


def drags(dice, count):
    """Glued, pressed, dragged by 1 to 4 mm."""
    for n in range(count):
        way, far_mm = dice.uniform(0, TURN), dice.uniform(1, 4)
        shift = (far_mm * math.cos(way), far_mm * math.sin(way))
        yield Scene([(glued, *place(dice), dice.uniform(1, 5), dice.uniform(8, 16), *shift)], FULL[n % 5])


def baselines(dice, count):
    """Loads of the other families on a skin that was inflated when its baseline was taken."""
    shifts = (0.0, -0.15, 0.3, -0.3)
    for n in range(count):
        base = (0.5, 1.0, 1.2)[(n + n // 3) % 3]
        makers = (
            lambda: [small(dice, *place(dice))], lambda: six(dice, n % 4 == 1), lambda: next(iter(several(dice, 1))).makers,
            lambda: [wide(dice, n // 7)], lambda: hand(dice), lambda: next(iter(neighbors(dice, 1))).makers,
            lambda: squeeze(dice, ("hill", "hug", "arc")[n // 7]))[n % 7]()
        yield Scene(makers, round(base + shifts[n % 4], 3), base)


FAMILIES = (("single", singles, 26), ("several", several, 20), ("neighbor", neighbors, 12), ("clamp", clamps, 8), ("squeeze", squeezes, 16),
            ("hand", hands, 8), ("plate", plates, 14), ("glued", drags, 10), ("baseline", baselines, 21))


def scenes():
    """Every scene in the table's order."""
    found = [Scene([], pressure) for pressure in INFLATED_KPA]
    for n, scene in enumerate(found):
        scene.family, scene.name, scene.held_out = "inflated", f"inflated_{1000 * scene.pressure:.0f}pa", int(n % 3 == 2)
    for family, make, count in FAMILIES:
        for n, scene in enumerate(make(random.Random(f"skin {family}"), count)):
            scene.family, scene.name, scene.held_out = family, f"{family}-{n + 1:02d}", int(n % 3 == 2)
            scene.turn = (n + 0.5) / count
            found.append(scene)
    return found
