"""Rigid bodies and pressure hills that touch a tube from outside. Units: mm, rad, MPa.

A body sits over the place (angle, z) of the unloaded outer wall. Its own axes are a: around, b: along Z, h: outward, with the origin on that wall.
"""

import math

OUTER = 40.0
BASE_AROUND, BASE_ALONG = 5.25, 4.5


def arc(angle):
    """The same angle in (-pi, pi]."""
    return math.pi - (math.pi - angle) % (2 * math.pi)


def dot(a, b):
    return sum(p * q for p, q in zip(a, b))


class Body:
    """`depth`: how far the lowest point is inside the unloaded outer wall; may be negative, as an inflated skin comes out to meet it.

    half_a, half_b: half widths of the footprint; round_a, round_b: radii of curvature around and along, 0: flat. An ellipse or a rectangle.
    """

    def __init__(self, kind, angle, z, depth, half_a, half_b, round_a=0.0, round_b=0.0, ellipse=True, drag=None):
        self.kind, self.angle, self.z, self.depth = kind, angle, z, depth
        self.half_a, self.half_b, self.round_a, self.round_b, self.ellipse = half_a, half_b, round_a, round_b, ellipse
        self.drag = drag
        self.glued = drag is not None
        self.out, self.around = (math.cos(angle), math.sin(angle), 0.0), (-math.sin(angle), math.cos(angle), 0.0)

    def local(self, x):
        return dot(x, self.around), x[2] - self.z, dot(x, self.out) - OUTER

    def world(self, a, b, h):
        """A vector, not a place."""
        return tuple(a * s + h * r for s, r in zip(self.around, self.out))[:2] + (b,)

    def covers(self, a, b):
        if self.ellipse:
            return (a / self.half_a) ** 2 + (b / self.half_b) ** 2 <= 1.0
        return abs(a) <= self.half_a and abs(b) <= self.half_b

    def height(self, a, b):
        """Of the body's surface, and its slopes."""
        h, slopes = -self.depth, []
        for at, radius in ((a, self.round_a), (b, self.round_b)):
            if radius:
                root = math.sqrt(max(radius * radius - at * at, 0.04 * radius * radius))
                h += radius - root
                slopes.append(at / root)
            else:
                slopes.append(0.0)
        return h, slopes

    def meets(self, x):
        """(penetration, outward normal, point of the body) at a place x of the skin; None outside the footprint."""
        a, b, h = self.local(x)
        if h < -OUTER or not self.covers(a, b):
            return None
        top, slopes = self.height(a, b)
        length = math.sqrt(1 + slopes[0] ** 2 + slopes[1] ** 2)
        normal = self.world(-slopes[0] / length, -slopes[1] / length, 1 / length)
        spot = tuple(OUTER * r for r in self.out)[:2] + (self.z,)
        point = tuple(s + w for s, w in zip(spot, self.world(a, b, top)))
        return (h - top) / length, normal, point

    def first_share(self):
        """The first active set is what would be inside by more than this share of the depth: a dent is smaller than the cut of the shapes."""
        if max(self.half_a, self.half_b) > 10:
            return 0.85
        return 0.7 if self.round_a or self.round_b else 0.0

    def drift(self):
        return self.world(self.drag[0], self.drag[1], 0.0) if self.glued else (0.0, 0.0, 0.0)

    def spans(self):
        """Half widths around and along that want fine elements."""
        return self.half_a, self.half_b


def disc(angle, z, depth, diameter, drag=None):
    return Body("disc", angle, z, depth, diameter / 2, diameter / 2, drag=drag)


def sphere(angle, z, depth, radius):
    reach = min(0.9 * radius, 14.0)
    return Body("sphere", angle, z, depth, reach, reach, radius, radius)


def finger(angle, z, depth, radius, length, along=False):
    """A cylinder lying across the skin, or along it."""
    reach = 0.85 * radius
    if along:
        return Body("finger", angle, z, depth, reach, length / 2, round_a=radius, ellipse=False)
    return Body("finger", angle, z, depth, length / 2, reach, round_b=radius, ellipse=False)


def plate(angle, z, depth, around, along, kind="plate"):
    return Body(kind, angle, z, depth, around / 2, along / 2, ellipse=False)


class Band(Body):
    """Presses a strip of the wall, `half_angle` either side, to one radius."""

    def __init__(self, angle, z, depth, half_angle, half_b):
        super().__init__("band", angle, z, depth, half_angle * OUTER, half_b, ellipse=False)

    def first_share(self):
        return 0.0

    def meets(self, x):
        angle = math.atan2(x[1], x[0])
        if abs(arc(angle - self.angle)) * OUTER > self.half_a + 1e-6 or abs(x[2] - self.z) > self.half_b:
            return None
        normal = (math.cos(angle), math.sin(angle), 0.0)
        radius = OUTER - self.depth
        return math.hypot(x[0], x[1]) - radius, normal, (radius * normal[0], radius * normal[1], x[2])


class Hill:
    """A smooth follower pressure, `peak` at the middle: cosine hills of the given half widths; half_a of None: all around."""

    glued = False

    def __init__(self, angle, z, peak, half_a, half_b):
        self.kind, self.angle, self.z, self.peak, self.half_a, self.half_b = "hill", angle, z, peak, half_a, half_b

    def pressure(self, angle, z):
        value = self.peak
        for at, half in ((arc(angle - self.angle) * OUTER, self.half_a), (z - self.z, self.half_b)):
            if half is not None:
                value *= 0.5 * (1 + math.cos(math.pi * at / half)) if abs(at) < half else 0.0
        return value

    def spans(self):
        return self.half_a or math.pi * OUTER, self.half_b


def spacing(half):
    """Element size for a body of this half width."""
    return min(max(half / 2.2, 2.1), 3.6)


def wanted(bodies, start, end, along):
    """Largest element size between two lines: along Z, or around in mm of arc."""
    size = BASE_ALONG if along else BASE_AROUND
    for body in bodies:
        half = body.spans()[1 if along else 0]
        middle = (start + end) / 2
        away = abs(middle - body.z) if along else abs(arc(middle / OUTER - body.angle)) * OUTER
        if away < half + 3.0 + (end - start) / 2:
            size = min(size, spacing(half))
    return size
