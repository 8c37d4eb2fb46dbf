"""print_messages.py ADDRESS EVENTS: what the Python client makes of a frame and of events, one JSON object a line."""

from __future__ import annotations

import dataclasses
import json
import sys
from typing import Any

import numpy as np

import taclink


def plain(value: Any) -> Any:
    if dataclasses.is_dataclass(value):
        return {field.name: plain(getattr(value, field.name)) for field in dataclasses.fields(value)}
    if isinstance(value, np.ndarray):
        return value.tolist()
    if isinstance(value, (list, tuple)):
        return [plain(one) for one in value]
    if hasattr(value, "items"):
        return {key: plain(one) for key, one in value.items()}
    return value


with taclink.Client(sys.argv[1]) as client:
    for frame in client.frames(detail="full"):
        print(json.dumps(plain(frame)))
        break
    left = int(sys.argv[2])
    for event in client.events():
        print(json.dumps(plain(event)))
        left -= 1
        if left == 0:
            break
