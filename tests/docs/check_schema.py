"""The JSON schema of the configuration takes the files that the server takes, and refuses wrong ones.

check_schema.py ROOT TACLINKD
"""

import copy
import json
import pathlib
import subprocess
import sys
from typing import Any

import jsonschema
import yaml

root, taclinkd = pathlib.Path(sys.argv[1]), sys.argv[2]


def output(*options: str | pathlib.Path) -> str:
    return subprocess.run([taclinkd, *options], capture_output=True, text=True, check=True).stdout


schema = json.loads(output("--print-schema"))
jsonschema.Draft202012Validator.check_schema(schema)
validator = jsonschema.Draft202012Validator(schema)
wrong = []

configurations = {str(path.relative_to(root)): path.read_text(encoding="utf-8")
                  for path in sorted((root / "deploy/config").glob("*.yaml"))}
for name in list(configurations):
    configurations[f"--print-config of {name}"] = output("--print-config", "--config", root / name)
configurations["--print-config of the demo"] = output("--print-config")
for name, text in configurations.items():
    wrong += [f"{name}: {error.json_path}: {error.message}" for error in validator.iter_errors(yaml.safe_load(text))]

demo = yaml.safe_load(configurations["deploy/config/demo.yaml"])
mistakes: list[tuple[tuple[str | int, ...], Any]] = [
    (("taclink_config",), 2),
    (("limits", "max_streams"), 0),
    (("limits", "max_steams"), 1),
    (("server", "listen"), 50051),
    (("events",), {"begin_n": "fast"}),
    (("log",), {"level": "loud"}),
    (("arm", "links"), []),
    (("arm", "links", 0, "source"), "film"),
    (("arm", "links", 0, "source"), "v4l2"),
    (("arm", "links", 0, "gain"), 3),
    (("arm", "links", 0, "pose"), {"position_mm": [1, 2]}),
    (("arm", "links", 0, "pressure"), {"source": "serial"}),
    (("arm", "links", 0, "pressure"), {"source": "constant", "kpa": 1, "baud": 9600}),
    (("publish",), {"site": "no-url"}),
]
good: list[tuple[tuple[str | int, ...], Any]] = [
    (("publish",), "nats://a:4222"),
    (("arm", "links", 0, "pressure_kpa"), 1.5),
    (("arm", "links", 0, "pressure"), {"source": "grpc", "stale_after_s": 2}),
]


def takes(path: tuple[str | int, ...], value: Any) -> bool:
    """Whether the demo with another value is valid."""
    changed = copy.deepcopy(demo)
    target = changed
    for step in path[:-1]:
        target = target[step]
    target[path[-1]] = value
    return validator.is_valid(changed)


wrong += [f"the schema takes {path}: {value}" for path, value in mistakes if takes(path, value)]
wrong += [f"the schema refuses {path}: {value}" for path, value in good if not takes(path, value)]
print(f"{len(configurations)} configurations, {len(mistakes)} mistakes", *wrong, sep="\n")
sys.exit(bool(wrong) or len(configurations) < 7)
