#!/usr/bin/env python3
"""Draws docs/reports/calculix.svg from results.csv: probe force against pressure, and the pushed path's shape."""

import csv
import os

HERE = os.path.dirname(os.path.abspath(__file__))
COLORS = {"neo-hookean": "#1f77b4", "st-venant-kirchhoff": "#d95f02"}
WIDTH, HEIGHT, LEFT, TOP = 400, 280, 60, 40


class Panel:
    def __init__(self, number, title, x_label, y_label, x_range, y_range):
        self.x0 = LEFT + number * (WIDTH + 90)
        self.x_range, self.y_range, self.parts, self.legend = x_range, y_range, [], []
        self.parts.append(f'<rect x="{self.x0}" y="{TOP}" width="{WIDTH}" height="{HEIGHT}" fill="none" stroke="#999"/>')
        self.text(self.x0 + WIDTH / 2, TOP - 14, title, "middle")
        self.text(self.x0 + WIDTH / 2, TOP + HEIGHT + 36, x_label, "middle")
        middle = TOP + HEIGHT / 2
        self.parts.append(f'<text transform="translate({self.x0 - 42} {middle}) rotate(-90)" text-anchor="middle">{y_label}</text>')

    def text(self, x, y, words, anchor="start", color="#222"):
        self.parts.append(f'<text x="{x:.1f}" y="{y:.1f}" text-anchor="{anchor}" fill="{color}">{words}</text>')

    def place(self, x, y):
        (x_low, x_high), (y_low, y_high) = self.x_range, self.y_range
        return self.x0 + WIDTH * (x - x_low) / (x_high - x_low), TOP + HEIGHT * (1 - (y - y_low) / (y_high - y_low))

    def ticks(self, xs, ys):
        for x in xs:
            at, _ = self.place(x, self.y_range[0])
            self.parts.append(f'<path d="M{at:.1f} {TOP + HEIGHT}v5" stroke="#999"/>')
            self.text(at, TOP + HEIGHT + 18, f"{x:g}", "middle")
        for y in ys:
            _, at = self.place(self.x_range[0], y)
            self.parts.append(f'<path d="M{self.x0} {at:.1f}h{WIDTH}" stroke="#eee"/>')
            self.text(self.x0 - 6, at + 4, f"{y:g}", "end")

    def line(self, points, color, dash="none", marks=True):
        placed = [self.place(*p) for p in points]
        path = " ".join(f"{x:.1f},{y:.1f}" for x, y in placed)
        self.parts.append(f'<polyline points="{path}" fill="none" stroke="{color}" stroke-width="1.8" stroke-dasharray="{dash}"/>')
        if marks:
            self.parts += [f'<circle cx="{x:.1f}" cy="{y:.1f}" r="2.6" fill="{color}"/>' for x, y in placed]


def forces(rows):
    panel = Panel(0, "Probe force at marker (7, 5)", "gauge pressure, kPa", "N", (0, 1.5), (0, 1.6))
    panel.ticks((0, 0.5, 1, 1.5), (0, 0.4, 0.8, 1.2, 1.6))
    for law, color in COLORS.items():
        for depth, dash in (("5", "5 3"), ("10", "none")):
            points = [(float(r["pressure_kpa"]), float(r["value"])) for r in rows
                      if r["case"] == "push-j5" and r["law"] == law and r["depth_mm"] == depth and r["quantity"] == "probe_force"]
            if points:
                panel.line(sorted(points), color, dash)
    for n, (law, color) in enumerate(COLORS.items()):
        panel.text(panel.x0 + 12, TOP + 20 + 17 * n, law, color=color)
    panel.text(panel.x0 + 12, TOP + 54, "dashed: 5 mm, full: 10 mm")
    return panel


def shape(rows):
    panel = Panel(1, "Inner wall, neo-Hookean: 10 mm at marker (7, 5), 1 kPa", "z, mm", "radius, mm", (0, 198), (25, 45))
    panel.ticks((0, 36, 90, 144, 198), (25, 30, 35, 40, 45))
    law = "neo-hookean"
    for path, color in (("7", "#1f77b4"), ("10", "#7570b3"), ("19", "#1b9e77")):
        points = [(18.0 * int(r["quantity"].split(":")[2]), float(r["value"])) for r in rows
                  if r["case"] == "push-j5" and r["law"] == law and (r["pressure_kpa"], r["depth_mm"]) == ("1", "10")
                  and r["quantity"].startswith(f"inner_radius:{path}:")]
        panel.line([(0, 36.5), *sorted(points), (198, 36.5)], color)
        panel.text(panel.x0 + WIDTH - 12, TOP + HEIGHT - 48 - 17 * len(panel.legend), f"path {path}", "end", color)
        panel.legend.append(path)
    half = [(float(r["quantity"].split("=")[1]), 36.5 + float(r["value"])) for r in rows
            if r["case"] == "tube-inflation" and r["law"] == law and r["quantity"].startswith("radial_inner:z=")]
    mirrored = [(198 - z, radius) for z, radius in half]
    panel.line([(0, 36.5), *sorted({*half, *mirrored}), (198, 36.5)], "#555", "2 3", marks=False)
    panel.text(panel.x0 + WIDTH - 12, TOP + HEIGHT - 14, "dotted: without the disc", "end")
    return panel


def main():
    with open(os.path.join(HERE, "results.csv"), encoding="ascii") as table:
        rows = list(csv.DictReader(table))
    parts = [*forces(rows).parts, *shape(rows).parts]
    size = f'width="{2 * (LEFT + WIDTH) + 60}" height="{TOP + HEIGHT + 50}"'
    with open(os.path.join(HERE, "../../../docs/reports/calculix.svg"), "w", encoding="ascii") as out:
        out.write(f'<svg xmlns="http://www.w3.org/2000/svg" {size} font-family="sans-serif" font-size="12">\n')
        out.write('<rect width="100%" height="100%" fill="white"/>\n' + "\n".join(parts) + "\n</svg>\n")


if __name__ == "__main__":
    main()
