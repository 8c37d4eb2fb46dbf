"""Input decks for CalculiX (ccx), and what its .dat file says. Units: mm, N, MPa."""

import os
import re
import subprocess
import time


def material(law, young, poisson):
    """Cards of a law.

    neo-hookean: W = C10 (I1/J^(2/3) - 3) + (J - 1)^2 / D1, with C10 = mu/2 and D1 = 2/K.
    st-venant-kirchhoff: with NLGEOM, CalculiX's *ELASTIC relates the second Piola-Kirchhoff stress to the Green-Lagrange strain.
    """
    if law == "st-venant-kirchhoff":
        return ["*ELASTIC", f"{young:.9g}, {poisson:.9g}"]
    if law == "neo-hookean":
        c10 = young / (4 * (1 + poisson))
        d1 = 6 * (1 - 2 * poisson) / young
        return ["*HYPERELASTIC, NEO HOOKE", f"{c10:.9g}, {d1:.9g}"]
    raise ValueError(law)


def listing(name, kind, numbers):
    rows = [f"*{kind}, {kind}={name}"]
    numbers = sorted(numbers)
    return rows + [", ".join(map(str, numbers[n : n + 12])) + "," for n in range(0, len(numbers), 12)]


def element_rows(numbers, kind, name):
    rows = [f"*ELEMENT, TYPE={kind}, ELSET={name}"]
    for number, nodes in numbers.items():
        cells = [str(number), *map(str, nodes)]
        rows.append(", ".join(cells[:12]) + ("," if len(cells) > 12 else ""))
        if len(cells) > 12:
            rows.append(", ".join(cells[12:]))
    return rows


class Deck:
    """A skin with clamped ends and symmetry planes, loaded in steps by inner pressure and a rigid disc."""

    def __init__(self, skin, law, young, poisson):
        self.skin, self.steps = skin, []
        self.nodes, self.disc_nodes = dict(skin.nodes), []
        self.body = element_rows(skin.elements, skin.kind, "SKIN")
        self.body += listing("INNER", "ELSET", skin.inner) + listing("ENDS", "NSET", skin.ends())
        self.bounds = ["ENDS, 1, 3"]
        self.law = ["*MATERIAL, NAME=SKIN", *material(law, young, poisson), "*SOLID SECTION, ELSET=SKIN, MATERIAL=SKIN"]
        self.contact = []

    def symmetric(self, name, nodes, axis):
        self.body += listing(name, "NSET", nodes)
        self.bounds.append(f"{name}, {axis}, {axis}")

    def add_disc(self, nodes, elements, facing, stiffness, friction):
        """A frictionless rigid disc unless `friction`; stiffness: penalty in MPa/mm; facing: outer elements it can touch."""
        self.disc_nodes = list(nodes)
        self.nodes.update(nodes)
        self.body += element_rows(elements, "C3D6", "DISC") + listing("DISC", "NSET", nodes)
        self.body += listing("FACING", "ELSET", facing)
        self.law.append("*SOLID SECTION, ELSET=DISC, MATERIAL=SKIN")
        self.bounds += ["DISC, 1, 3"]
        self.contact = [
            "*SURFACE, NAME=WALL", "FACING, S2", "*SURFACE, NAME=FRONT", "DISC, S1",
            "*SURFACE INTERACTION, NAME=TOUCH", "*SURFACE BEHAVIOR, PRESSURE-OVERCLOSURE=LINEAR", f"{stiffness:.9g}"]
        if friction:
            self.contact += ["*FRICTION", f"{friction:.9g}, {stiffness / 10:.9g}"]
        self.contact += ["*CONTACT PAIR, INTERACTION=TOUCH, TYPE=SURFACE TO SURFACE", "WALL, FRONT"]

    def add_step(self, pressure_mpa, disc_y=None, first=0.25, largest=0.25):
        """Ramps from the end of the step before: gauge pressure on the inner wall, the disc's displacement along Y."""
        rows = ["*STEP, NLGEOM, INC=400", "*STATIC", f"{first}, 1., 1e-4, {largest}", "*DLOAD", f"INNER, P1, {pressure_mpa:.9g}"]
        if disc_y is not None:
            rows += ["*BOUNDARY", f"DISC, 2, 2, {disc_y:.9g}"]
        rows += ["*NODE PRINT, NSET=WATCHED, FREQUENCY=1000", "U"]
        if disc_y is not None:
            rows += ["*NODE PRINT, NSET=DISC, TOTALS=ONLY", "RF"]
        self.steps += [*rows, "*END STEP"]

    def text(self, watched):
        """The deck; displacements of the `watched` nodes are printed."""
        rows = ["*NODE, NSET=ALL"]
        rows += [f"{n}, {x:.9g}, {y:.9g}, {z:.9g}" for n, (x, y, z) in self.nodes.items()]
        rows += self.body + listing("WATCHED", "NSET", watched) + self.law + self.contact
        rows += ["*BOUNDARY", *self.bounds, *self.steps]
        return "\n".join(rows) + "\n"


class Result:
    """Per step, at its end: positions of the watched nodes, and the resultant on the disc at every increment."""

    def __init__(self, path, nodes):
        self.displacements, self.forces = {}, []
        section = step = None
        lines = open(path, encoding="ascii").read().splitlines() if os.path.exists(path) else []
        for line in lines:
            head = re.match(r"\s*(displacements|total force) .*for set (\S+) and time\s+(\S+)", line)
            if head:
                section, step = head[1], float(head[3])
                continue
            cells = line.split()
            if section == "displacements" and len(cells) == 4:
                self.displacements.setdefault(round(step, 6), {})[int(cells[0])] = tuple(map(float, cells[1:]))
            elif section == "total force" and len(cells) == 3:
                self.forces.append((step, tuple(map(float, cells))))
        self.nodes = nodes

    def displacement(self, step, node):
        return self.displacements[float(step)][node]

    def position(self, step, node):
        return tuple(a + b for a, b in zip(self.nodes[node], self.displacement(step, node)))

    def force(self, step):
        """Resultant that the disc's support exerts at the end of a step, N."""
        return next(f for t, f in self.forces if abs(t - step) < 1e-6)


def ended(log):
    """Whether ccx ran to its end, good or bad: an interrupted run says neither."""
    if not os.path.exists(log):
        return False
    words = open(log, encoding="ascii", errors="replace").read()
    return "Job finished" in words or "*ERROR" in words


def solve(deck, folder, name, watched, steps, limit_s):
    """Runs ccx in `folder`, unless it already came to an end with this very deck there. The result has the steps that converged;
    `result.reached` of them. Raises RuntimeError when there is none, no ccx, or no end in time."""
    os.makedirs(folder, exist_ok=True)
    base = os.path.join(folder, name)
    words = deck.text(watched)
    before = open(base + ".inp", encoding="ascii").read() if os.path.exists(base + ".inp") else None
    if before != words or not ended(base + ".log"):
        if limit_s <= 0:
            raise RuntimeError(f"{base}: not solved yet")
        for suffix in (".log", ".dat"):
            if os.path.exists(base + suffix):
                os.remove(base + suffix)
        with open(base + ".inp", "w", encoding="ascii") as out:
            out.write(words)
        run(base, limit_s)
    result = Result(base + ".dat", deck.nodes)
    result.reached = next((n for n in range(steps) if float(n + 1) not in result.displacements), steps)
    if result.reached < steps:
        print(f"  {name}: converged in {result.reached} of {steps} steps", flush=True)
    if result.reached == 0:
        raise RuntimeError(f"{base}: no step converged; see {base}.log")
    return result


def run(base, limit_s):
    folder, name = os.path.split(base)
    began = time.monotonic()
    environment = {**os.environ, "OMP_NUM_THREADS": "1"}
    with open(base + ".log", "w", encoding="ascii") as log:
        try:
            subprocess.run(["ccx", name], cwd=folder, env=environment, stdout=log, stderr=log, timeout=limit_s, check=False)
        except FileNotFoundError as error:
            raise RuntimeError("there is no ccx on the PATH; install the Debian package calculix-ccx") from error
        except subprocess.TimeoutExpired as error:
            raise RuntimeError(f"{base}: ccx took more than {limit_s} s") from error
    print(f"  {name}: {time.monotonic() - began:.0f} s", flush=True)
    for suffix in (".frd", ".12d", ".cvg"):
        if os.path.exists(base + suffix):
            os.remove(base + suffix)
