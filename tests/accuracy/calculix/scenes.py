#!/usr/bin/env python3
"""Scenes of a touched robot skin, solved with ccx as three-dimensional solids: writes scenes.csv, scene_contacts.csv and scene_markers.csv.

Needs ccx (Debian: calculix-ccx) and Python 3, nothing else. A scene that was solved before is read, not solved again.
docs/reports/calculix.md says what is solved. Units: mm, N, MPa, rad; kPa only in names and in the tables.
"""

import argparse
import bisect
import csv
import fnmatch
import json
import math
import os
import sys

import solid
from families import INFLATED_KPA, scenes

SHARES = (1.0, 0.5)  # of the depths, tried in turn
COLUMNS = {
    "scenes.csv": ["scene", "family", "held_out", "pressure_kpa", "baseline_kpa", "contacts"],
    "scene_contacts.csv": [
        "scene", "contact", "kind", "glued", "fx_n", "fy_n", "fz_n", "normal_force_n", "cx_mm", "cy_mm", "cz_mm", "ext_around_mm", "ext_along_mm"],
    "scene_markers.csv": ["scene", *(f"{axis}{n}" for n in range(solid.PATHS * solid.RINGS) for axis in "xyz")]}


class Store:
    """Results by scene in the work folder, each with the key of what was solved."""

    def __init__(self, folder):
        self.folder = folder
        os.makedirs(folder, exist_ok=True)

    def path(self, name):
        return os.path.join(self.folder, name + ".json")

    def get(self, name, key):
        if not os.path.exists(self.path(name)):
            return None
        with open(self.path(name), encoding="ascii") as held:
            found = json.load(held)
        return found if found["key"] == key else None

    def put(self, name, key, **result):
        with open(self.path(name), "w", encoding="ascii") as out:
            json.dump({"key": key, **result}, out)
        return self.get(name, key)


class Inflated:
    """The skin under pressure alone: markers, and how its outer wall moves along z."""

    def __init__(self, store, limit_s):
        self.store = store
        if any(self.get(p) is None for p in INFLATED_KPA):
            skin = solid.tube_mesh([])
            load = solid.Load(skin, [], skin.nodes)
            steps = solid.solve(skin, load, [p * 1e-3 for p in INFLATED_KPA], store.folder, "inflated", limit_s)
            outer = [skin.ids[0, k, len(skin.depths) - 1] for k in range(len(skin.zs))]
            for pressure, step in zip(INFLATED_KPA, steps):
                profile = [(skin.nodes[n][2], step["displacements"][n][0], step["displacements"][n][2]) for n in outer]
                store.put(self.name(pressure), "", markers=solid.Touched(skin, load, step).markers(), profile=profile, contacts=[])

    @staticmethod
    def name(pressure):
        return f"inflated_{1000 * pressure:.0f}pa"

    def get(self, pressure):
        return self.store.get(self.name(pressure), "")

    def grown(self, pressure, z):
        """(radial, along z) displacement of the outer wall, in between linearly."""
        if pressure == 0:
            return 0.0, 0.0
        profile = self.profiles(pressure)
        k = min(max(bisect.bisect([row[0] for row in profile], z), 1), len(profile) - 1)
        (za, *a), (zb, *b) = profile[k - 1], profile[k]
        share = (z - za) / (zb - za)
        return tuple(p + share * (q - p) for p, q in zip(a, b))

    def profiles(self, pressure):
        self.read = getattr(self, "read", {})
        if pressure not in self.read:
            self.read[pressure] = self.get(pressure)["profile"]
        return self.read[pressure]

    def shift(self, pressure, x):
        """Displacement of the outer wall's node at x."""
        out, along = self.grown(pressure, x[2])
        radius = math.hypot(x[0], x[1])
        return out * x[0] / radius, out * x[1] / radius, along


def solve_scene(scene, inflated, store, limit_s):
    """The stored result, or a new one; None where nothing converged."""
    found = store.get(scene.name, scene.key())
    if found is None:
        for share in SHARES:
            bodies = scene.bodies(lambda z: inflated.grown(scene.pressure, z)[0], share)
            try:
                state = solid.press(bodies, scene.pressure * 1e-3, lambda x: inflated.shift(scene.pressure, x), store.folder, scene.name, limit_s)
                normals = state.normals()
                contacts = [c for c in (state.contact(n, normals) for n in range(len(bodies))) if c]
                if not contacts:
                    raise RuntimeError(f"{scene.name}: nothing touches")
            except RuntimeError as error:
                print("  failed:", error, flush=True)
                continue
            found = store.put(scene.name, scene.key(), markers=state.markers(), contacts=contacts, share=share)
            break
        else:
            found = store.put(scene.name, scene.key(), markers=None, contacts=[])
    return found if found["markers"] else None


def rows(scene, result):
    """Lines of the three tables."""
    contacts = []
    for number, c in enumerate(result["contacts"]):
        numbers = [f"{v:.5f}" for v in (*c["force"], c["normal_force"])] + [f"{v:.3f}" for v in (*c["centre"], *c["extent"])]
        contacts.append([scene.name, number, c["kind"], c["glued"], *numbers])
    about = [scene.name, scene.family, scene.held_out, f"{scene.pressure:g}", f"{scene.baseline:g}", len(contacts)]
    return [about], contacts, [[scene.name, *(f"{v + 0.0:.4f}" for u in result["markers"] for v in u)]]


def write(folder, listed, store):
    tables = [[], [], []]
    for scene in listed:
        result = store.get(scene.name, "" if scene.family == "inflated" else scene.key())
        if result and result["markers"]:
            for table, lines in zip(tables, rows(scene, result)):
                table += lines
    for (name, columns), table in zip(COLUMNS.items(), tables):
        path = os.path.join(folder, name)
        with open(path + ".new", "w", encoding="ascii", newline="") as out:
            writer = csv.writer(out, lineterminator="\n")
            writer.writerow(columns)
            writer.writerows(table)
        os.replace(path + ".new", path)


def main():
    here = os.path.dirname(os.path.abspath(__file__))
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--work", default=os.path.join(here, "../../../build/calculix/scenes"), help="folder for decks and results")
    parser.add_argument("--out", default=here, help="folder for the three tables")
    parser.add_argument("--only", default="*", help="solve only scenes or families that match, as hand or 'plate-0*'; the tables have all that is solved")
    parser.add_argument("--list", action="store_true", help="list the scenes")
    parser.add_argument("--limit", type=float, default=150, help="seconds for each run of ccx")
    options = parser.parse_args()
    listed, store = scenes(), Store(options.work)
    if options.list:
        for scene in listed:
            print(scene.name, scene.family, f"held out {scene.held_out}", f"{scene.pressure:g} kPa, baseline {scene.baseline:g} kPa", scene.key())
        return 0
    inflated, failed = Inflated(store, options.limit), 0
    touched = [s for s in listed if s.family != "inflated" and (fnmatch.fnmatch(s.name, options.only) or fnmatch.fnmatch(s.family, options.only))]
    for scene in sorted(touched, key=lambda s: s.turn):  # a few of every family first
        solved = store.get(scene.name, scene.key()) is not None
        failed += solve_scene(scene, inflated, store, options.limit) is None
        if not solved:
            write(options.out, listed, store)
    write(options.out, listed, store)
    return 1 if failed else 0


if __name__ == "__main__":
    sys.exit(main())
