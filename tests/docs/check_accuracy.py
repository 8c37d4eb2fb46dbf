"""Pages say what reports hold: check_accuracy.py ROOT

docs/measurements.md's table of forces is that of tests/accuracy/report.csv. What STATED names of README and of
docs/guides/judge.md has the numbers of its report; the latter states no other numbers. README is short.
"""

import collections
import csv
import pathlib
import re
import sys

root = pathlib.Path(sys.argv[1])
README = "README.md"
README_LINES = 90
JUDGE = "docs/guides/judge.md"
ROWS = {  # of the report, and in the table
    "exact": "exact",
    "noise": "0.1 mm of noise",
    "missing": "a fifth missing",
    "noise and missing": "both",
    "pressure 100 Pa off": "noise, pressure 100 Pa off",
    "three wrong": "noise, three markers up to 10 mm off",
    "images": "images of the solids",
}
MEASUREMENTS = "docs/measurements.md"
CALCULIX = "docs/reports/calculix.md"
SWEEP = "docs/reports/sweep.md"
VISION = "docs/reports/vision-accuracy.md"
WHOLE = "docs/reports/whole-accuracy.md"
COUNT = r"(\d[\d ]*)"  # with spaces between thousands
CELL = r"[^|]*\| "


def cells(number):
    """So many cells of a table that do not matter."""
    return f"(?:{CELL}){{{number}}}"


UNDISTURBED = r"### Nothing is wrong with the link .*?\| all \| "
MEDIAN_P99 = rf"([\d.]+) \| {CELL}([\d.]+) \| "

SOLIDS = r"Markers of (\d+) scenes of three-dimensional solids"
SOLIDS_ROW = r"\| images of the solids \| (\d+) \| (\d+) \| (\d+) \|"
CYLINDER, BARREL = (rf"\| tracked \| {skin} \| ([\d.]+) \|" for skin in ("cylinder", "barrel"))
SCENES = r"(\d+) scenes, \d+ stereo pairs after the rest frames"
PRESS, UNTOUCHED = (rf"\| {row} \| {MEDIAN_P99}" for row in ("a press, slowly", "untouched"))

SWEPT_ALL = r"\| all \| all \| "
MEDIAN_P95 = r"([\d.]+) / ([\d.]+) \| "
SWEPT = rf"{SWEPT_ALL}{cells(5)}{MEDIAN_P95}{cells(1)}{MEDIAN_P95}{cells(4)}([\d.]+) to ([\d.]+) \|"

# By page what it states; the report; where that has the numbers. All texts with single spaces.
STATED = {
    README: (
        ("of {} scenes of three-dimensional solids", MEASUREMENTS, SOLIDS),
        ("forces of {} hold", MEASUREMENTS, SOLIDS_ROW),
        ("{2} are silently wrong", MEASUREMENTS, SOLIDS_ROW),
        ("forces of {4} to {5} N are off by {2} % (median) and {3} % (95th percentile), centers by {0} and {1} mm", SWEEP, SWEPT),
        ("{} mm (cylinder)", VISION, CYLINDER),
        ("{} mm (barrel)", VISION, BARREL),
        ("over {} rendered scenes", VISION, SCENES),
        ("{} ms median", MEASUREMENTS, PRESS),
        ("{} ms untouched", MEASUREMENTS, UNTOUCHED),
    ),
    JUDGE: (
        ("fitted to {} probe forces", CALCULIX, r"to the (\w+) probe forces under pressure"),
        ("these forces with {} % mean error, {} % at worst", MEASUREMENTS, r"MPa\): ([\d.]+) % mean error, ([\d.]+) % at worst"),
        ("{} % mean error, {} % at worst", CALCULIX, r"with it, and the largest \| \*\*([\d.]+) %\*\*, ([\d.]+) % \|"),
        ("on another day differed by {} to {} %", CALCULIX, r"same push on another day differed by (\d+) to (\d+) %"),
        ("In one real image {} of {} markers", MEASUREMENTS, r"real picture of a barrel link (\d+) of (\d+) markers"),
        ("within {} % or {} N, each center within {} mm, and nothing else is above {} N", MEASUREMENTS,
         r"within (\d+) % or ([\d.]+) N as a vector .*?, each center within (\d+) mm, and nothing else is above ([\d.]+) N"),
        ("Images of {} solids:", MEASUREMENTS, SOLIDS),
        ("solids: {} hold, {} are reported, {} are silently wrong", MEASUREMENTS, SOLIDS_ROW),
        ("Markers with {} mm of noise: {} hold, {} are silently wrong", MEASUREMENTS,
         rf"\| ([\d.]+) mm of noise \| (\d+) \| {CELL}(\d+) \|"),
        ("without a fault: {1} % of {0} frames are right", WHOLE, rf"Of the {COUNT} undisturbed frames ([\d.]+) % are right"),
        ("{} of {} `ok` frames are silently wrong", WHOLE,
         rf"of both skins, {COUNT} of {COUNT} `ok` frames \([\d.]+ %\) are silently wrong"),
        ("With injected faults: {} of {} are silently wrong, {} with", WHOLE,
         rf"With a fault it is {COUNT} of {COUNT}: {COUNT} are the swapped barrel"),
        ("within {} % down to {} mm, a {} too small from {} mm on", WHOLE,
         r"forces are within (\d+) % down to dents of (\d+) mm \(.*?\), and a (\w+) too small from (\d+) mm on"),
        ("Squeezes all around: {} % of frames", WHOLE, r"Of hugs and squeezes all around, ([\d.]+) % \("),
        ("without a fault, {} % of force vectors", WHOLE, rf"{UNDISTURBED}{cells(5)}([\d.]+) % \|"),
        ("`ok` forces of {4} to {5} N are off by {2} % (median) and {3} % (95th percentile), centers by {0} and {1} mm", SWEEP, SWEPT),
        ("{} of {} inflated barrels falsely report `cameras_moved`", SWEEP, r"false alarm here: (\d+) of the (\d+) links of the barrel"),
        ("With `degraded` frames: {} % (95th percentile)", SWEEP, rf"{SWEPT_ALL}{cells(6)}[\d.]+ / ([\d.]+) \|"),
        ("{} mm (cylinder)", VISION, CYLINDER),
        ("{} mm (barrel)", VISION, BARREL),
        ("over {} rendered scenes", VISION, SCENES),
        ("at worst {} mm, beside a deep dent", MEASUREMENTS, r"the worst marker of all is ([\d.]+) mm off, beside a deep dent"),
        ("on a shared {}-core machine", MEASUREMENTS, r"On a shared (\d+)-core machine"),
        ("untouched {} and {} ms", MEASUREMENTS, UNTOUCHED),
        ("slow press {} and {} ms", MEASUREMENTS, PRESS),
        ("stroke at {} mm/s {} and {} ms", MEASUREMENTS, rf"\| a stroke at (100) mm/s \| {MEDIAN_P99}"),
        ("short taps {} and {} ms", MEASUREMENTS, rf"\| taps of a tenth of a second \| {MEDIAN_P99}"),
        ("{} links {} and {} ms with {} % of the exposures skipped", MEASUREMENTS,
         rf"\| (\w+) links \(.*?\) \| {MEDIAN_P99}{CELL}(\d+) % \|"),
        ("is found {} times in {}", WHOLE, r"those that were found: it says (\d+) of (\d+)"),
        ("{} % were found without a fault", WHOLE, rf"{UNDISTURBED}{cells(6)}([\d.]+) % \|"),
        ("{} % with faults", WHOLE, rf"### Faults .*?\| all \| {cells(6)}([\d.]+) % \|"),
        ("there, {2} N of a body of {0} to {1} mm", WHOLE,
         r"A body of (\d+) to (\d+) mm that presses between the clamp and the first ring with ([\d.]+) N on a slack skin"),
        ("up to {} of the force is not found", WHOLE, r"up to (\w+) of its force is not found"),
        ("With a modulus {} % too high at {} kPa, {} % of frames are `ok`, but only {} % are right", WHOLE,
         rf"\| E configured (\d+) % too high, ([\d.]+) kPa \| {CELL}([\d.]+) % \| {CELL}([\d.]+) % \|"),
        ("On a slack skin that becomes {} K warmer", WHOLE, r"A skin that is (\d+) K warmer"),
        ("only {} % of frames are right, though `ok`", WHOLE, r"but only (\d+) % of its frames are right"),
        ("A failed camera is reported within a {}", "docs/faults.md", r"it says so within a (\w+) and names the camera"),
    ),
}


def page(name):
    return (root / name).read_text(encoding="utf-8")


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

if (lines := page(README).count("\n")) > README_LINES:
    wrong.append(f"README has {lines} lines: more than {README_LINES}; move reference text to docs")

for name, statements in STATED.items():
    text = " ".join(re.sub(r"\]\([^)]*\)", "]", page(name)).split())  # without the targets of links
    checked = [False] * len(text)
    for stated, report, pattern in statements:
        found = re.search(pattern, " ".join(page(report).split()))
        phrase = stated.format(*map(str.strip, found.groups())) if found else ""
        place = text.find(phrase) if found else -1
        if not found:
            wrong.append(f"{report} lacks what {name} states of it: {stated}")
        elif place < 0:
            wrong.append(f"{name} lacks, as {report} has it: {phrase}")
        else:
            checked[place : place + len(phrase)] = [True] * len(phrase)
    for found in re.finditer(r"(?<!\w)\d", text if name == JUDGE else ""):
        if not checked[found.start()]:
            wrong.append(f"{name} states a number that STATED lacks: {text[found.start() - 30 : found.end() + 30]}")
print(*wrong or ["the pages say what the reports hold"], sep="\n")
sys.exit(bool(wrong))
