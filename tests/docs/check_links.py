"""Every relative link of a Markdown page leads to a file, and to a heading where it names one."""

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
print(f"{len(pages)} pages", *wrong, sep="\n")
sys.exit(bool(wrong) or not pages)
