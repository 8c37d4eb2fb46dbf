"""Structured hexahedral meshes of a skin: a surface of revolution about Z with a thickness.

Units: mm, rad. Grid indices: i around, k along, m through the thickness (0 on the inner wall), counted in half
elements for quadratic elements and in whole elements for linear ones.
"""

import math


class Tube:
    """Cylinder; `length` along Z, wall between the radii `inner` and `inner + thickness`."""

    def __init__(self, inner=36.5, thickness=3.5, length=198.0):
        self.inner, self.thickness, self.length = inner, thickness, length

    def point(self, z, depth):
        """(radius, z) at `depth` inside the outer surface."""
        return self.inner + self.thickness - depth, z


class Barrel:
    """The outer meridian is a circular arc; thickness along its normal, so the end faces are oblique."""

    def __init__(self, end=36.28, middle=53.36, thickness=3.5, length=260.0):
        self.thickness, self.length, self.middle = thickness, length, middle
        sagitta, half = middle - end, length / 2
        self.arc = (half * half + sagitta * sagitta) / (2 * sagitta)

    def point(self, z, depth):
        slope = math.asin((z - self.length / 2) / self.arc)
        arm = self.arc - depth
        return self.middle - self.arc + arm * math.cos(slope), self.length / 2 + arm * math.sin(slope)


def graded(start, end, count, ratio):
    """`count` intervals from start to end, the last `ratio` times as long as the first; without the last point."""
    step = ratio ** (1 / (count - 1)) if count > 1 else 1.0
    lengths = [step**n for n in range(count)]
    scale = (end - start) / sum(lengths)
    points, at = [], start
    for length in lengths:
        points.append(at)
        at += length * scale
    return points


def lines(breaks, counts, ratios):
    """Grid lines over consecutive intervals: element count and last-to-first ratio of each."""
    points = []
    for start, end, count, ratio in zip(breaks, breaks[1:], counts, ratios):
        points += graded(start, end, count, ratio)
    return points + [breaks[-1]]


class SkinMesh:
    """Elements between angle lines (rad), z lines and `layers` through the thickness.

    kind: C3D20R, C3D20 or C3D8I. Local axes are (angle, z, radius), so face 1 is the inner wall, face 2 the outer.
    """

    def __init__(self, shape, angles, zs, layers, kind="C3D20R"):
        self.shape, self.kind = shape, kind
        self.stride = 2 if kind.startswith("C3D20") else 1
        self.angles, self.zs = self._refine(angles), self._refine(zs)
        self.depths = self._refine([shape.thickness * (1 - n / layers) for n in range(layers + 1)])
        self.nodes, self.ids = {}, {}
        self.elements, self.inner, self.outer, self.cells = {}, [], [], {}
        self._make_nodes()
        self._make_elements(layers)

    def _refine(self, points):
        if self.stride == 1:
            return list(points)
        out = []
        for a, b in zip(points, points[1:]):
            out += [a, (a + b) / 2]
        return out + [points[-1]]

    def _make_nodes(self):
        for k, z in enumerate(self.zs):
            for m, depth in enumerate(self.depths):
                for i, angle in enumerate(self.angles):
                    if self.stride == 2 and i % 2 + k % 2 + m % 2 > 1:
                        continue
                    radius, at = self.shape.point(z, depth)
                    number = len(self.nodes) + 1
                    self.ids[i, k, m] = number
                    self.nodes[number] = (radius * math.cos(angle), radius * math.sin(angle), at)

    def _make_elements(self, layers):
        s = self.stride
        corners = [(0, 0, 0), (s, 0, 0), (s, s, 0), (0, s, 0), (0, 0, s), (s, 0, s), (s, s, s), (0, s, s)]
        edges = [(0, 1), (1, 2), (2, 3), (3, 0), (4, 5), (5, 6), (6, 7), (7, 4), (0, 4), (1, 5), (2, 6), (3, 7)]
        offsets = list(corners)
        if s == 2:
            offsets += [tuple((corners[a][d] + corners[b][d]) // 2 for d in range(3)) for a, b in edges]
        for k in range(0, len(self.zs) - 1, s):
            for i in range(0, len(self.angles) - 1, s):
                for m in range(0, len(self.depths) - 1, s):
                    number = len(self.elements) + 1
                    self.elements[number] = [self.ids[i + a, k + b, m + c] for a, b, c in offsets]
                    self.cells[number] = (i, k)
                    if m == 0:
                        self.inner.append(number)
                    if m == (layers - 1) * s:
                        self.outer.append(number)

    def where(self, test):
        """Node numbers whose (i, k, m) pass."""
        return [number for key, number in self.ids.items() if test(*key)]

    def ends(self):
        last = len(self.zs) - 1
        return self.where(lambda i, k, m: k in (0, last))

    def side(self, angle):
        """Nodes on the plane at this angle."""
        return self.where(lambda i, k, m: abs(self.angles[i] - angle) < 1e-9)

    def node(self, angle, z, m):
        """The node at (angle, z); m counts from the inner wall, -1 is the outer surface. KeyError if there is none."""
        i = min(range(len(self.angles)), key=lambda n: abs(self.angles[n] - angle))
        k = min(range(len(self.zs)), key=lambda n: abs(self.zs[n] - z))
        if abs(self.angles[i] - angle) > 1e-9 or abs(self.zs[k] - z) > 1e-6:
            raise KeyError((angle, z))
        return self.ids[i, k, m % len(self.depths)]

    def near(self, angle, z, arc, length):
        """Outer elements that reach within `arc` rad and `length` mm of a place."""
        found = []
        for number in self.outer:
            i, k = self.cells[number]
            if self.angles[i] < angle + arc and self.zs[k + self.stride] > z - length and self.zs[k] < z + length:
                found.append(number)
        return found

    def __str__(self):
        around, along, through = (
            (len(n) - 1) // self.stride for n in (self.angles, self.zs, self.depths))
        return f"{self.kind} {around}x{along}x{through}"


def half_disc(first_node, first_element, radius, y, z, sectors, thickness=1.0):
    """A half disc (x <= 0) facing -Y at height y, axis through (0, y, z), of C3D6 wedges.

    Returns (nodes, elements); face 1 of each wedge is the flat front. `radius` is that of the circle of the same area.
    """
    step = math.pi / sectors
    rim = radius * math.sqrt(step / math.sin(step))
    front = [(0.0, z)] + [(-rim * math.sin(n * step), z + rim * math.cos(n * step)) for n in range(sectors + 1)]
    nodes = {}
    for layer in range(2):
        for n, (x, along) in enumerate(front):
            nodes[first_node + layer * len(front) + n] = (x, y + layer * thickness, along)
    elements = {}
    for n in range(sectors):
        a, b, c = first_node, first_node + n + 2, first_node + n + 1
        lower, upper = (a, b, c), tuple(p + len(front) for p in (a, b, c))
        elements[first_element + n] = [*lower, *upper]
    return nodes, elements
