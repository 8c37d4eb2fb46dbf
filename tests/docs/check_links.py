"""Every relative link of a Markdown page leads to a file, and to a heading where it names one; every citation in a
comment, such as [duong2021, (4.27)], has an entry in docs/references.md; docs/architecture.md and the guides stay short."""

import pathlib
import re
import sys

root = pathlib.Path(sys.argv[1])
skipped = {"node_modules", "build", ".git"}
pages = [p for p in root.rglob("*.md") if not skipped & set(p.relative_to(root).parts)]


def anchors(page: pathlib.Path) -> set[str]:
    headings = re.findall(r"^#+ (.*)$", page.read_text(encoding="utf-8"), re.M)
    return {re.sub(r"[^\w\- ]", "", h.lower()).replace(" ", "-") for h in headings}


wrong = []
for page in pages:
    text = re.sub(r"```.*?```", "", page.read_text(encoding="utf-8"), flags=re.S)
    for target in re.findall(r"\]\(([^)\s]+)\)", text):
        if re.match(r"[a-z]+:", target):
            continue
        path, _, anchor = target.partition("#")
        file = (page.parent / path).resolve() if path else page
        if not file.exists():
            wrong.append(f"{page.relative_to(root)}: {target} is not there")
        elif anchor and file.suffix == ".md" and anchor not in anchors(file):
            wrong.append(f"{page.relative_to(root)}: {path or 'the page'} has no heading #{anchor}")
references = (root / "docs/references.md").read_text(encoding="utf-8")
keys = re.findall(r"^\*\*\[([a-z0-9]+)\]\*\*", references, re.M)
wrong += [f"docs/references.md has {key} twice" for key in set(keys) if keys.count(key) > 1]
cited = set()
for folder in ("bench", "client", "mcap", "proto", "sensing", "server", "tests", "wire"):
    for source in (root / folder).rglob("*"):
        if source.suffix not in {".h", ".cpp", ".proto"} or skipped & set(source.relative_to(root).parts):
            continue
        for line in source.read_text(encoding="utf-8").splitlines():
            comment = line.partition("//")[2]
            for key in re.findall(r"\[([a-z]+[0-9]{4})[a-z]?(?:, [^\]]*)?\]", comment):
                cited.add(key)
                if key not in keys:
                    wrong.append(f"{source.relative_to(root)} cites {key}, which docs/references.md does not have")
if len(cited) < 10:
    wrong.append("comments cite fewer than ten sources: is the pattern right?")

# The most words that a page may have.
MOST_WORDS = {"docs/architecture.md": 1800}
GUIDES = ("extend", "judge", "mount", "program", "run", "try")
MOST_WORDS_OF_A_GUIDE = 600
guides = {p.relative_to(root).as_posix() for p in (root / "docs/guides").glob("*.md")}
wrong += [f"docs/guides/{name}.md is missing" for name in GUIDES if f"docs/guides/{name}.md" not in guides]
for name, most in (MOST_WORDS | dict.fromkeys(sorted(guides), MOST_WORDS_OF_A_GUIDE)).items():
    words = len((root / name).read_text(encoding="utf-8").split())
    if words > most:
        wrong.append(f"{name} has {words} words; {most} is the limit")
print(f"{len(pages)} pages", *wrong, sep="\n")
sys.exit(bool(wrong) or not pages)
