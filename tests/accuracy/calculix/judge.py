#!/usr/bin/env python3
"""CalculiX as an independent judge of a skin's mechanics: runs the cases below with ccx and writes results.csv.

Needs ccx (Debian: calculix-ccx) and Python 3, nothing else. A case that was solved before is read, not solved again.
docs/reports/calculix.md says what is solved and what came out. Units: mm, N, MPa, rad; kPa only in names and in the table.
"""

import argparse
import csv
import math
import os
import sys
from collections import namedtuple

from deck import Deck, solve
from mesh import Barrel, SkinMesh, Tube, half_disc, lines

NEO, SVK = "neo-hookean", "st-venant-kirchhoff"
YOUNG = 0.1
PRESSURES_KPA = (0.5, 1.0, 1.5)
PATH_PITCH, RING_PITCH, RINGS = math.pi / 12, 18.0, 10
PUSHED_ANGLE = math.pi / 2
DISC_RADIUS = 2.75
PENALTY = 2.0  # MPa/mm: 0.03 mm of overlap on average at 1.4 N

# A St. Venant-Kirchhoff bar under compression is weaker the more it is pressed beyond a stretch of 1/sqrt(3), and turns
# inside out: where the wall under the disc is thinner than that, the law says nothing about a skin.
CRUSHED = 1 / math.sqrt(3)

COLUMNS = ["case", "law", "E_mpa", "nu", "pressure_kpa", "depth_mm", "quantity", "value", "unit", "mesh"]
Inflation = namedtuple("Inflation", "case shape law nu kind around along layers pressures profile")
Push = namedtuple("Push", "case law nu ring depth fineness layers kind friction penalty shape_kpa",
                  defaults=(4, 2, "C3D20", 0.0, PENALTY, None))


class Table:
    """Rows of results.csv."""

    def __init__(self):
        self.rows = []

    def add(self, case, law, nu, pressure, depth, quantity, value, unit, mesh):
        cells = [case, law, f"{YOUNG:g}", f"{nu:g}", f"{pressure:g}", f"{depth:g}", quantity, f"{value:.5f}", unit, mesh]
        self.rows.append(cells)
        if not quantity.startswith(("inner_radius", "radial_")) or quantity.endswith((":7:5", ":7:8", ":middle")):
            print("   ", ", ".join(cells), flush=True)

    def write(self, path):
        with open(path, "w", encoding="ascii", newline="") as out:
            writer = csv.writer(out, lineterminator="\n")
            writer.writerow(COLUMNS)
            writer.writerows(self.rows)


def solve_inflation(case, work, table, limit_s):
    """A quarter of the skin, its whole length; profile: the pressure whose radial displacements are listed along z,
    which is that of the outer surface; the other half of the length is its mirror image."""
    shape, half = case.shape, case.shape.length / 2
    zs = lines([0, half, 2 * half], [case.along] * 2, [4, 0.25])
    skin = SkinMesh(shape, lines([0, math.pi / 2], [case.around], [1]), zs, case.layers, case.kind)
    deck = Deck(skin, case.law, YOUNG, case.nu)
    deck.symmetric("SIDE_X", skin.side(math.pi / 2), 1)
    deck.symmetric("SIDE_Y", skin.side(0), 2)
    for pressure in case.pressures:
        deck.add_step(pressure * 1e-3)
    levels = {"inner": 0, "middle": len(skin.depths) // 2, "outer": -1}
    stride = skin.stride
    watched = {}
    for k, z in enumerate(skin.zs):
        if k % stride == 0 and 0 < k < len(skin.zs) - 1:
            watched[z] = {name: skin.ids[0, k, m % len(skin.depths)] for name, m in levels.items()}
    name = f"{case.case}_{case.law}_{case.nu:g}_{str(skin).replace(' ', '_')}"
    result = solve(deck, work, name, [n for at in watched.values() for n in at.values()], len(case.pressures), limit_s)
    for step, pressure in enumerate(case.pressures[: result.reached], 1):
        for z, at in watched.items():
            middle = abs(z - half) < 1e-9
            for level, node in at.items():
                value = result.displacement(step, node)[0]
                if middle:
                    table.add(case.case, case.law, case.nu, pressure, 0, f"radial_{level}:middle", value, "mm", str(skin))
                if pressure == case.profile and level != "outer" and z < half + 1e-9:
                    table.add(case.case, case.law, case.nu, pressure, 0, f"radial_{level}:z={z:.3f}", value, "mm", str(skin))


def exact_plane_strain(inner, outer, growth, mu):
    """Pressure in a long incompressible neo-Hookean tube, held axially, whose inner radius grows: the integral of
    (sigma_theta - sigma_r) dr / r with a difference of mu (s^2 - 1/s^2) at the hoop stretch s, by Simpson's rule."""
    swept = (inner + growth) ** 2 - inner**2
    low, high, count = inner + growth, math.sqrt(outer**2 + swept), 200
    total = 0.0
    for n in range(count + 1):
        r = low + (high - low) * n / count
        stretch = r / math.sqrt(r * r - swept)
        total += (1 if n in (0, count) else 4 if n % 2 else 2) * mu * (stretch**2 - stretch**-2) / r
    return total * (high - low) / count / 3


def solve_plane_strain(work, table, limit_s):
    """The deck against the exact solution: law, follower pressure and element at once."""
    tube, pressure, nu = Tube(length=4.0), 1.0, 0.4999
    skin = SkinMesh(tube, lines([0, math.pi / 2], [6], [1]), [0.0, 2.0, 4.0], 2)
    deck = Deck(skin, NEO, YOUNG, nu)
    deck.bounds = ["ENDS, 3, 3"]
    deck.symmetric("SIDE_X", skin.side(math.pi / 2), 1)
    deck.symmetric("SIDE_Y", skin.side(0), 2)
    deck.add_step(pressure * 1e-3)
    node = skin.node(0, 2.0, 0)
    result = solve(deck, work, "plane-strain", [node], 1, limit_s)
    table.add("plane-strain", NEO, nu, pressure, 0, "radial_inner:middle", result.displacement(1, node)[0], "mm", str(skin))
    low, high = 0.0, 20.0
    for _ in range(60):
        growth = (low + high) / 2
        small = exact_plane_strain(tube.inner, tube.inner + tube.thickness, growth, YOUNG / 3) < pressure * 1e-3
        low, high = (growth, high) if small else (low, growth)
    table.add("plane-strain", NEO, 0.5, pressure, 0, "radial_inner:middle", low, "mm", "exact")


def push_mesh(ring, fineness, layers, kind):
    """Half of the tube, x <= 0, with a line at every path and ring, fine where the disc pushes."""
    f = fineness
    around = [f, (f + 1) // 2, 2] + [1] * 9
    angles = lines([PUSHED_ANGLE + n * PATH_PITCH for n in range(13)], around, [3, 2] + [1] * 10)
    along, ratios = [], []
    for n in range(RINGS + 1):
        away = n - ring if n >= ring else ring - 1 - n
        along.append((f + 1, (f + 1) // 2)[away] if away < 2 else 2)
        ratio = (5.0, 2.0)[away] if away < 2 else 1.0
        ratios.append(ratio if n >= ring else 1 / ratio)
    zs = lines([RING_PITCH * n for n in range(RINGS + 2)], along, ratios)
    return SkinMesh(Tube(), angles, zs, layers, kind)


def solve_push(case, work, table, limit_s):
    """The disc goes in first, then the pressure rises: the state is elastic, so the order does not matter without friction, and
    ccx 2.20 does not converge when a prescribed displacement changes in a later step of an inflated rubber."""
    skin = push_mesh(case.ring, case.fineness, case.layers, case.kind)
    z, outer = RING_PITCH * case.ring, Tube().inner + Tube().thickness
    deck = Deck(skin, case.law, YOUNG, case.nu)
    deck.symmetric("SYMMETRY", sorted({*skin.side(PUSHED_ANGLE), *skin.side(PUSHED_ANGLE + math.pi)}), 1)
    gap = 0.2
    nodes, elements = half_disc(1000001, 100001, DISC_RADIUS, outer + gap, z, 12)
    deck.add_disc(nodes, elements, skin.near(PUSHED_ANGLE, z, 0.25, 10.0), case.penalty, case.friction)
    loads = (0.0, *PRESSURES_KPA)
    for pressure in loads:
        deck.add_step(pressure * 1e-3, -gap - case.depth, *((0.2, 0.2) if pressure == 0 else (0.34, 0.34)))
    markers = {(p, j): skin.node(PUSHED_ANGLE + (p - 7) * PATH_PITCH, RING_PITCH * j, 0)
               for p in range(7, 20) for j in range(1, RINGS + 1)}
    front = skin.node(PUSHED_ANGLE, z, -1)
    kind = f"{case.depth:g}mm_mu{case.friction:g}_k{case.penalty:g}_{str(skin).replace(' ', '_')}"
    name = f"{case.case}{case.ring}_{case.law}_{case.nu:g}_{kind}"
    result = solve(deck, work, name, [*markers.values(), front], len(loads), limit_s)
    for step, pressure in enumerate(loads[: result.reached], 1):
        def add(quantity, value, unit="mm", pressure=pressure):
            table.add(f"{case.case}-j{case.ring}", case.law, case.nu, pressure, case.depth, quantity, value, unit, str(skin))
        wall = result.position(step, front)[1] - result.position(step, markers[7, case.ring])[1]
        if wall < CRUSHED * Tube().thickness:
            print(f"    at {pressure:g} kPa the wall under the disc is {wall:.2f} mm: no result", flush=True)
            break
        add("probe_force", -2 * result.force(step)[1], "N")
        add(f"outer_radius:7:{case.ring}", result.position(step, front)[1])
        for (p, j), node in markers.items():
            if pressure == case.shape_kpa or (p, j) == (7, case.ring):
                x, y, _ = result.position(step, node)
                add(f"inner_radius:{p}:{j}", math.hypot(x, y))


def cases():
    """In the order of their worth; each name is what --only selects by its beginning."""
    tube, barrel = Tube(), Barrel()
    usual = ("C3D20R", 6, 16, 2)
    yield "plane-strain", None
    for law in (NEO, SVK):
        yield "tube-inflation", Inflation("tube-inflation", tube, law, 0.49, *usual, PRESSURES_KPA, 1.0)
    for law, shape_kpa in ((NEO, 1.0), (SVK, 0.5)):
        yield "push", Push("push", law, 0.49, 5, 5)
        yield "push", Push("push", law, 0.49, 5, 10, shape_kpa=shape_kpa)
    yield "mesh-inflation", Inflation("mesh-inflation", tube, NEO, 0.49, "C3D20R", 4, 8, 1, PRESSURES_KPA, None)
    yield "mesh-inflation", Inflation("mesh-inflation", tube, NEO, 0.49, "C3D20R", 9, 28, 3, PRESSURES_KPA, None)
    yield "mesh-inflation", Inflation("mesh-inflation", tube, NEO, 0.49, "C3D20", 6, 16, 2, PRESSURES_KPA, None)
    yield "mesh-inflation", Inflation("mesh-inflation", tube, NEO, 0.49, "C3D8I", 12, 24, 2, PRESSURES_KPA, None)
    for nu in (0.495, 0.499):
        yield "nu-inflation", Inflation("nu-inflation", tube, NEO, nu, *usual, PRESSURES_KPA, None)
    yield "mesh-push", Push("mesh-push", NEO, 0.49, 5, 10, 3, 1)
    yield "nu-push", Push("nu-push", NEO, 0.495, 5, 10)
    for law in (NEO, SVK):
        yield "barrel-inflation", Inflation("barrel-inflation", barrel, law, 0.49, "C3D20R", 6, 20, 2, PRESSURES_KPA, 1.0)
    for depth in (5, 10):
        yield "push", Push("push", NEO, 0.49, 8, depth)
    yield "mesh-push", Push("mesh-push", NEO, 0.49, 5, 5, 4, 2, "C3D20R", 0.0, 10.0)
    yield "mesh-push", Push("mesh-push", NEO, 0.49, 5, 10, 6, 2)
    yield "friction-push", Push("friction-push", NEO, 0.49, 5, 10, friction=0.5)
    yield "penalty-push", Push("penalty-push", NEO, 0.49, 5, 10, penalty=3 * PENALTY)


def main():
    here = os.path.dirname(os.path.abspath(__file__))
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--work", default=os.path.join(here, "../../../build/calculix"), help="folder for decks and solutions")
    parser.add_argument("--out", default=os.path.join(here, "results.csv"))
    parser.add_argument("--only", default="", help="run only cases whose name begins so; the table has only those")
    parser.add_argument("--limit", type=float, default=1200, help="seconds for each run of ccx; 0: only read what is solved")
    options = parser.parse_args()
    table, failed = Table(), []
    for name, case in cases():
        if not name.startswith(options.only):
            continue
        print(name, "" if case is None else f"{case.law} nu={case.nu:g}", flush=True)
        try:
            if case is None:
                solve_plane_strain(options.work, table, options.limit)
            else:
                (solve_inflation if isinstance(case, Inflation) else solve_push)(case, options.work, table, options.limit)
        except RuntimeError as error:
            failed.append(str(error))
            print("  failed:", error, flush=True)
        table.write(options.out)
    return 1 if failed else 0


if __name__ == "__main__":
    sys.exit(main())
