"""README's table of the accuracy of forces says what tests/accuracy/report.csv holds: check_accuracy.py ROOT"""

import collections
import csv
import pathlib
import re
import sys

root = pathlib.Path(sys.argv[1])
ROWS = {  # of the report, and in README
    "exact": "exact",
    "noise": "0.1 mm of noise",
    "missing": "a fifth missing",
    "noise and missing": "both",
    "pressure 100 Pa off": "noise, pressure 100 Pa off",
    "three wrong": "noise, three markers up to 10 mm off",
    "images": "images of the solids",
}
with open(root / "tests/accuracy/report.csv", encoding="utf-8") as file:
    rows = list(csv.DictReader(line for line in file if not line.startswith("#")))
counts = collections.Counter((row["input"], row["verdict"]) for row in rows)
held_out = collections.Counter(row["input"] for row in rows if row["held_out"] == "yes" and row["verdict"] == "holds")
readme = (root / "README.md").read_text(encoding="utf-8")
wrong = [f"the report has an input '{name}' that the table lacks" for name in {row["input"] for row in rows} - set(ROWS)]
for name, label in ROWS.items():
    numbers = [counts[name, verdict] for verdict in ("holds", "reported", "silent")] + [held_out[name]]
    line = f"| {label} | " + " | ".join(map(str, numbers)) + " |"
    if not re.search("^" + re.escape(line) + "$", readme, re.M):
        wrong.append(f"README lacks the line: {line}")
print(*wrong or ["README's table is that of the report"], sep="\n")
sys.exit(bool(wrong))
