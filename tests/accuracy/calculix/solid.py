"""Solves a whole tube under inner pressure and touching bodies with ccx: frictionless contact by an active set, glued bodies, hills.

A frictionless body holds each node that it touches on its own tangent plane; a node that would be pulled is let go and a node that would
be inside is caught, and the whole is solved again. The force on a node is what ccx calls RF: exact, whatever the contact.
"""

import math
import os
import re

from deck import Deck, run
from mesh import SkinMesh, Tube, lines
from touch import OUTER, Hill, arc, dot, wanted

YOUNG, POISSON = 0.1, 0.49
PATHS, RINGS, PITCH = 24, 10, 18.0
TENSION = 0.02  # of a body's force: what may be left
INSIDE = 0.15  # mm: a node deeper in a body than this is caught
ROUNDS = 7
CATCHES = 3  # rounds after which nodes are only let go: at a rim they come and go for ever
TIGHT = ("*CONTROLS, PARAMETERS=FIELD", "0.001, 0.05, 0., 0., 0.02, 1e-5, 1e-3, 1e-8")  # residual: 0.1 % of the mean force; last correction: 5 % of the step


class WholeTube(SkinMesh):
    """The whole circumference: the last angle line is the first."""

    def _make_nodes(self):
        super()._make_nodes()
        last = len(self.angles) - 1
        for (i, k, m), number in list(self.ids.items()):
            if i == last:
                del self.nodes[number]
                self.ids[i, k, m] = self.ids[0, k, m]


def tube_mesh(bodies, layers=1, kind="C3D8I", finer=1.0):
    """Node lines at every path and ring; fine elements where a body touches."""
    arcs = [OUTER * 2 * math.pi * n / PATHS for n in range(PATHS + 1)]
    zs = [PITCH * n for n in range(RINGS + 2)]
    counts = [[math.ceil(finer * (b - a) / wanted(bodies, a, b, along) - 0.05) for a, b in zip(at, at[1:])]
              for along, at in ((False, arcs), (True, zs))]
    angles = lines([a / OUTER for a in arcs], counts[0], [1.0] * PATHS)
    return WholeTube(Tube(), angles, lines(zs, counts[1], [1.0] * (RINGS + 1)), layers, kind)


def add(*vectors):
    return tuple(map(sum, zip(*vectors)))


def minus(a, b):
    return tuple(p - q for p, q in zip(a, b))


def cross(a, b):
    return (a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0])


class Load:
    """What holds the outer wall: per body {node: (normal, offset)} of n.u = offset, or {node: displacement} if glued; hills as pressures."""

    def __init__(self, skin, bodies, shape):
        """shape: position of every outer node in a first guess."""
        self.skin, self.bodies = skin, bodies
        last = len(skin.zs) - 1
        self.outer = [n for (i, k, m), n in skin.ids.items() if m == len(skin.depths) - 1 and 0 < k < last and i < len(skin.angles) - 1]
        self.held = [{} for _ in bodies]
        self.grip(shape, None)

    def grip(self, shape, forces, catch=True):
        """Next active set; forces: nodal forces of the last solution, None at first; catch: not only let go. Says whether it differs from the last."""
        changed, taken = False, set()
        for number, body in enumerate(self.bodies):
            if isinstance(body, Hill) or (body.glued and forces):
                continue
            before, now = self.held[number], {}
            near = {n: body.meets(shape[n]) for n in self.outer if n not in taken}
            near = {n: meeting for n, meeting in near.items() if meeting}
            least = max([m[0] for m in near.values()], default=0.0) * body.first_share() if forces is None else INSIDE if catch else math.inf
            for node, (depth, normal, point) in near.items():
                if body.glued:
                    if depth > 0:
                        now[node] = minus(add(point, body.drift()), self.skin.nodes[node])
                elif self.keeps(node, before, depth, forces, max(least, 0.0)):
                    now[node] = (normal, dot(normal, minus(point, self.skin.nodes[node])))
            changed = changed or set(now) != set(before)
            taken |= set(now)
            self.held[number] = now
        return changed

    @staticmethod
    def keeps(node, before, depth, forces, least):
        if forces is None or node not in before:
            return depth > least
        return dot(forces[node], before[node][0]) < 0

    def tension(self, forces):
        """Largest share of pull in a frictionless body's force."""
        worst = 0.0
        for body, held in zip(self.bodies, self.held):
            if held and not body.glued:
                along = [dot(forces[n], normal) for n, (normal, _) in held.items()]
                push = -sum(f for f in along if f < 0)
                worst = max(worst, sum(f for f in along if f > 0) / push if push else 1.0)
        return worst

    def inside(self, shape):
        """Deepest that a free node is inside a body."""
        found = [0.0]
        for body, held in zip(self.bodies, self.held):
            if not isinstance(body, Hill) and not body.glued:
                found += [body.meets(shape[n])[0] for n in self.outer if n not in held and body.meets(shape[n])]
        return max(found)

    def centre(self, element):
        """(angle, z) of an unloaded element."""
        i, k = self.skin.cells[element]
        return (self.skin.angles[i] + self.skin.angles[i + 1]) / 2, (self.skin.zs[k] + self.skin.zs[k + 1]) / 2

    def hills(self):
        """{element: pressure on its outer face}."""
        skin, found = self.skin, {}
        for number in skin.outer:
            value = sum(b.pressure(*self.centre(number)) for b in self.bodies if isinstance(b, Hill))
            if value:
                found[number] = value
        return found


class TouchedDeck(Deck):
    """One step: pressure, bodies and hills rise together; or several steps of pressure alone."""

    def __init__(self, skin, load, pressures):
        super().__init__(skin, "neo-hookean", YOUNG, POISSON)
        bounds, turned = [], []
        for body, held in zip(load.bodies, load.held):
            for node, value in held.items():
                if body.glued:
                    bounds += [f"{node}, {d}, {d}, {u:.9g}" for d, u in enumerate(value, 1)]
                else:
                    turned += [f"*TRANSFORM, NSET=N{node}, TYPE=R", self.frame(value[0])]
                    self.body += [f"*NSET, NSET=N{node}", f"{node}"]
                    bounds.append(f"{node}, 1, 1, {value[1]:.9g}")
        self.contact = turned
        hills = [f"{e}, P2, {q:.9g}" for e, q in load.hills().items()]
        for pressure in pressures:
            share = 0.5 if pressure < 0.25e-3 else 0.34 if pressure < 0.6e-3 else 0.25
            self.steps += ["*STEP, NLGEOM, INC=60", "*STATIC", f"{share}, 1., 1e-3, {share}", *TIGHT, "*DLOAD", f"INNER, P1, {pressure:.9g}", *hills]
            self.steps += ["*BOUNDARY", *bounds] if bounds else []
            self.steps += ["*NODE PRINT, NSET=ALL, FREQUENCY=1000, GLOBAL=YES", "U, RF", "*END STEP"]

    @staticmethod
    def frame(normal):
        """Two axes of a local system whose first is the normal."""
        other = cross(normal, (0.0, 0.0, 1.0)) if abs(normal[2]) < 0.9 else (0.0, 1.0, 0.0)
        return ", ".join(f"{v:.12g}" for v in (*normal, *other))


def read(path):
    """[{"displacements": {node: vector}, "forces": {node: vector}}] of the steps that converged."""
    steps, part = [], None
    for line in open(path, encoding="ascii") if os.path.exists(path) else []:
        head = re.match(r"\s*(displacements|forces) .*time\s+(\S+)", line)
        if head:
            step = math.ceil(float(head[2]) - 1e-6)
            while len(steps) < step:
                steps.append({})
            part = steps[step - 1].setdefault(head[1], {})
            continue
        cells = line.split()
        if part is not None and len(cells) == 4:
            part[int(cells[0])] = tuple(map(float, cells[1:]))
    return steps


def solve(skin, load, pressures, folder, name, limit_s):
    """Every step's displacements and nodal forces; RuntimeError if one did not converge in time."""
    deck = TouchedDeck(skin, load, pressures)
    os.makedirs(folder, exist_ok=True)
    base = os.path.join(folder, name)
    for suffix in (".log", ".dat"):
        if os.path.exists(base + suffix):
            os.remove(base + suffix)
    with open(base + ".inp", "w", encoding="ascii") as out:
        out.write(deck.text([1]))
    run(base, limit_s)
    steps = read(base + ".dat")
    if len(steps) < len(pressures) or "*ERROR" in open(base + ".log", encoding="ascii", errors="replace").read():
        raise RuntimeError(f"{name}: did not converge")
    return steps


class Touched:
    """A solved scene."""

    def __init__(self, skin, load, step):
        self.skin, self.load = skin, load
        self.moved, self.forces = step["displacements"], step["forces"]
        self.shape = {n: add(skin.nodes[n], u) for n, u in self.moved.items()}

    def markers(self):
        """Displacements of the inner wall, rings outer, paths inner."""
        return [self.moved[self.skin.node(2 * math.pi * p / PATHS, PITCH * j, 0)] for j in range(1, RINGS + 1) for p in range(PATHS)]

    def normals(self):
        """{outer node: outward normal of the deformed wall}."""
        found = {}
        for number in self.skin.outer:
            corners = self.skin.elements[number][4:8]
            a, b, c, d = (self.shape[n] for n in corners)
            area = cross(minus(c, a), minus(d, b))
            for node in corners:
                found[node] = add(found.get(node, (0.0, 0.0, 0.0)), area)
        return {n: tuple(v / math.hypot(*area) for v in area) for n, area in found.items()}

    def touched_nodes(self, number):
        body, held = self.load.bodies[number], self.load.held[number]
        if not isinstance(body, Hill):
            return sorted(held)
        faces = [e for e in self.load.hills() if body.pressure(*self.load.centre(e))]
        return sorted({n for e in faces for n in self.skin.elements[e][4:8]})

    def contact(self, number, normals):
        """What the table says of one body; None where it does not touch."""
        body, nodes = self.load.bodies[number], self.touched_nodes(number)
        if not nodes:
            return None
        weights = {n: math.hypot(*self.forces[n]) for n in nodes}
        total = sum(weights.values())
        centre = [sum(weights[n] * self.shape[n][d] for n in nodes) / total for d in range(3)]
        arcs = {n: arc(math.atan2(self.shape[n][1], self.shape[n][0]) - body.angle) * math.hypot(*self.shape[n][:2]) for n in nodes}
        heights = {n: self.shape[n][2] for n in nodes}
        return {
            "kind": body.kind, "glued": int(body.glued), "force": add(*(self.forces[n] for n in nodes)),
            "normal_force": -sum(dot(self.forces[n], normals[n]) for n in nodes), "centre": centre,
            "extent": [half_width(at, weights) for at in (arcs, heights)]}


def half_width(at, weights):
    """Half the range that has 95 % of the weight; a single node counts as 1 mm."""
    total, passed, low, high = sum(weights.values()), 0.0, None, 0.0
    for node in sorted(at, key=at.get):
        passed += weights[node]
        if low is None and passed >= 0.025 * total:
            low = at[node]
        high = at[node]
        if passed >= 0.975 * total:
            break
    return max((high - low) / 2, 1.0)


def press(bodies, pressure, guess, folder, name, limit_s, mesh=None):
    """guess: (node's place) -> displacement of the outer wall under this pressure alone."""
    skin = mesh or tube_mesh(bodies)
    shape = {n: add(x, guess(x)) for n, x in skin.nodes.items()}
    load = Load(skin, bodies, shape)
    for number in range(ROUNDS):
        step = solve(skin, load, [pressure], folder, f"{name}-{number}", limit_s)[0]
        state = Touched(skin, load, step)
        tension, inside = load.tension(state.forces), load.inside(state.shape)
        print(f"  {name} round {number}: pull {tension:.3f}, inside {inside:.2f} mm, {sum(map(len, load.held))} nodes", flush=True)
        if tension < TENSION and (inside < 2 * INSIDE or number >= 2):
            return state
        if number + 1 < ROUNDS and not load.grip(state.shape, state.forces, number < CATCHES):
            return state
    raise RuntimeError(f"{name}: pull of {tension:.3f} is left")
