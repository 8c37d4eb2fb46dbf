"""Every test that the tables of docs/faults.md name is in the sources, and there are as many faults as promised.

check_faults.py ROOT
"""

import pathlib
import re
import sys

FEWEST = 60
GTEST = r"^(?:TYPED_)?TEST(?:_[FP])?\(\s*(\w+),\s*(\w+)\)"

root = pathlib.Path(sys.argv[1])
page = (root / "docs" / "faults.md").read_text(encoding="utf-8")


def texts(folder: str, pattern: str) -> list[tuple[pathlib.Path, str]]:
    files = sorted((root / folder).rglob(pattern))
    return [(file, file.read_text(encoding="utf-8")) for file in files]


def all_tests() -> set[str]:
    """By the names that ctest and pytest have for them; of suites with parameters, without these."""
    names = set()
    for _, text in texts("tests", "*.cpp"):
        names |= {".".join(match) for match in re.findall(GTEST, text, re.M)}
    for file, text in texts("client/python/tests", "test_*.py"):
        names |= {f"{file.stem}.{name}" for name in re.findall(r"^(?:async )?def (test_\w+)\(", text, re.M)}
    for _, text in texts("tests", "CMakeLists.txt"):
        names |= set(re.findall(r"add_test\(NAME ([\w.]+)", text))
    return names


def faults() -> list[tuple[str, list[str]]]:
    """What happens, and the names in the last column of tables that have one for tests."""
    found = []
    in_table = False
    for line in page.splitlines():
        cells = [cell.strip() for cell in line.strip("|").split("|")] if line.startswith("|") else []
        if not cells:
            in_table = False
        elif cells[-1].startswith("Test"):
            in_table = True
        elif in_table and not set(line) <= set("|-") and not cells[0].startswith("**"):
            found.append((cells[0], re.findall(r"`(\w+(?:\.\w+)+)`", cells[-1])))
    return found


tests, named = all_tests(), faults()
wrong = [f"{fault}: names no test" for fault, names in named if not names]
wrong += [f"{fault}: there is no test {name}" for fault, names in named for name in names if name not in tests]
if len(named) < FEWEST:
    wrong.append(f"only {len(named)} faults of {FEWEST}")
print(f"{len(named)} faults, {len(tests)} tests", *wrong, sep="\n")
sys.exit(bool(wrong))
