"""Pages say what reports hold: check_accuracy.py ROOT

docs/measurements.md's table of forces is that of tests/accuracy/report.csv; README's numbers are those of the report, of
docs/reports/vision-accuracy.md and of docs/measurements.md's table of time; README is short.
"""

import collections
import csv
import pathlib
import re
import sys

root = pathlib.Path(sys.argv[1])
README_LINES = 90
ROWS = {  # of the report, and in the table
    "exact": "exact",
    "noise": "0.1 mm of noise",
    "missing": "a fifth missing",
    "noise and missing": "both",
    "pressure 100 Pa off": "noise, pressure 100 Pa off",
    "three wrong": "noise, three markers up to 10 mm off",
    "images": "images of the solids",
}


def page(name):
    return (root / name).read_text(encoding="utf-8")


def number(name, pattern):
    """The number that a page gives; none: empty."""
    found = re.search(pattern, page(name), re.M)
    return found.group(1) if found else ""


with open(root / "tests/accuracy/report.csv", encoding="utf-8") as file:
    rows = list(csv.DictReader(line for line in file if not line.startswith("#")))
counts = collections.Counter((row["input"], row["verdict"]) for row in rows)
held_out = collections.Counter(row["input"] for row in rows if row["held_out"] == "yes" and row["verdict"] == "holds")
table = page("docs/measurements.md")
wrong = [f"the report has an input '{name}' that the table lacks" for name in {row["input"] for row in rows} - set(ROWS)]
for name, label in ROWS.items():
    numbers = [counts[name, verdict] for verdict in ("holds", "reported", "silent")] + [held_out[name]]
    line = f"| {label} | " + " | ".join(map(str, numbers)) + " |"
    if not re.search("^" + re.escape(line) + "$", table, re.M):
        wrong.append(f"docs/measurements.md lacks the line: {line}")

scenes = sum(count for (name, _), count in counts.items() if name == "images")
vision = r"^\| tracked \| {} \| ([\d.]+) \|"
time = r"^\| {} \| ([\d.]+) \|"
readme = " ".join(page("README.md").split())
for phrase in (
    f"of {scenes} scenes of three-dimensional solids",
    f"forces of {counts['images', 'holds']} hold",
    f"{counts['images', 'silent']} are silently wrong",
    number("docs/reports/vision-accuracy.md", vision.format("cylinder")) + " mm (cylinder)",
    number("docs/reports/vision-accuracy.md", vision.format("barrel")) + " mm (barrel)",
    number("docs/measurements.md", time.format("a press, slowly")) + " ms median",
    number("docs/measurements.md", time.format("untouched")) + " ms untouched",
):
    if phrase not in readme:
        wrong.append(f"README lacks: {phrase}")
if (lines := page("README.md").count("\n")) > README_LINES:
    wrong.append(f"README has {lines} lines: more than {README_LINES}; move reference text to docs")
print(*wrong or ["the pages say what the reports hold"], sep="\n")
sys.exit(bool(wrong))
