"""What pages say to type is there: subcommands and options of the programs, keys of the configuration, files.

check_pages.py ROOT FOLDER-OF-PROGRAMS
"""

import copy
import functools
import pathlib
import re
import subprocess
import sys
import tempfile
import textwrap

import yaml

root, programs = pathlib.Path(sys.argv[1]), pathlib.Path(sys.argv[2])
skipped = {"node_modules", "build", ".git"}
pages = [p for p in root.rglob("*.md") if not skipped & set(p.relative_to(root).parts)]
folders = "bench|client|cmake|deploy|docs|mcap|proto|sensing|server|tests|web|wire"
wrong = []


@functools.cache
def help_of(*command: str) -> tuple[str, frozenset[str]]:
    """The help text of a command, and its subcommands."""
    program, *words = command
    text = subprocess.run([programs / program, *words, "--help"], capture_output=True, text=True, check=True).stdout
    # Commands stand under headings of their own; options begin with a dash, and positionals are no commands.
    listed = re.sub(r"^Positionals:\n(?:  .*\n)*", "", text, flags=re.M)
    return text, frozenset(re.findall(r"^  ([a-z][a-z-]*)  ", listed, re.M))


def check_command(page: str, line: str) -> bool:
    """One call of a program; what is behind two spaces explains it."""
    match = re.match(r"(taclink(?:d|-bench)?)((?: \S+)*)", line)
    if not match:
        return False
    program, words = match[1], re.split(r" [|>&#]", match[2])[0].split()
    command = [program]
    for word in words:
        if word.split("|")[0] not in help_of(*command)[1]:
            break
        command.append(word.split("|")[0])
    text, subcommands = help_of(*command)
    following = words[len(command) - 1 :]
    if subcommands and following and re.fullmatch(r"[a-z][a-z-]+", following[0]):
        wrong.append(f"{page}: '{' '.join(command)}' has no '{following[0]}': {line}")
    for option in re.findall(r"(--[a-z][a-z0-9-]*)", " ".join(following)):
        if not re.search(option + r"(?![a-z0-9-])", text):
            wrong.append(f"{page}: '{' '.join(command)}' has no {option}: {line}")
    return True


def code(text: str) -> list[str]:
    """Lines of code and spans of it."""
    lines, fenced = [], False
    for line in text.splitlines():
        if line.lstrip().startswith("```"):
            fenced = not fenced
        elif fenced or line.startswith("    "):
            lines.append(line.strip())
        else:
            lines += re.findall(r"`([^`]+)`", line)
    return lines


def complaint_about(config: dict) -> str:
    """What the server says of it; empty: it takes it."""
    with tempfile.NamedTemporaryFile("w", suffix=".yaml") as file:
        yaml.safe_dump(config, file)
        file.flush()
        run = subprocess.run([programs / "taclinkd", "--print-config", "--config", file.name], capture_output=True,
                             text=True, check=False)
    return "" if run.returncode == 0 else run.stderr.strip()


def check_config(page: str, block: str) -> None:
    """A part of a configuration: sections of it, or keys of a link, a simulated one or one with cameras."""
    simulated = {"name": "one", "model": "cylinder", "source": "simulated", "scene": "press", "pace": "clock"}
    with_cameras = {"name": "one", "model": "cylinder", "source": "v4l2", "devices": ["/dev/video0", "/dev/video2"]}
    part = yaml.safe_load(block)
    complaints = []
    for place, link in (("top", simulated), ("arm", simulated), ("link", simulated), ("link", with_cameras)):
        config = {"taclink_config": 1, "arm": {"name": "arm", "links": [copy.deepcopy(link)]}}
        target = {"top": config, "arm": config["arm"], "link": config["arm"]["links"][0]}[place]
        for key, value in part.items():
            target[key] = value
        config["arm"].setdefault("name", "arm")
        config["arm"]["links"] = [given if "source" in given else {**link, **given} for given in config["arm"].get("links", [link])]
        complaint = complaint_about(config)
        if not complaint:
            return
        complaints.append(complaint)
    wrong.append(f"{page}: no configuration takes\n{block}\n  " + "\n  ".join(complaints))


commands = configurations = files = 0
for path in pages:
    page, text = str(path.relative_to(root)), path.read_text(encoding="utf-8")
    for line in code(text):
        commands += check_command(page, line)
    for block in re.findall(r"^ *```yaml\n(.*?)^ *```", text, re.M | re.S):
        block = textwrap.dedent(block)
        keys = re.findall(r"^(\w+):", block, re.M)
        for part in [block] if len(keys) == len(set(keys)) else block.splitlines():
            check_config(page, part)
            configurations += 1
    for name in re.findall(rf"(?<![\w./-])((?:{folders})/[\w./-]*\w)(?![\w./*-])", "\n".join(code(text))):
        if "/my-" in name:  # the user's own
            continue
        files += 1
        if not (root / name).exists() and not (path.parent / name).exists():
            wrong.append(f"{page}: {name} is not there")
print(f"{len(pages)} pages: {commands} commands, {configurations} configurations, {files} files", *wrong, sep="\n")
sys.exit(bool(wrong) or not commands or not configurations or not files)
