"""The examples, as a user runs them."""

from __future__ import annotations

import re
import signal
import subprocess
import sys
from pathlib import Path

import forces
import pytest
import server as servers

ALL = sorted(path.name for path in servers.EXAMPLES.glob("*.py") if path.name != "common.py")


def test_print_contacts(server: servers.Server, touched: None, library: Path, tmp_path: Path) -> None:
    options = ("--server", server.address, "--count", "2", "--rate", "10")
    done = servers.run_example(library, tmp_path, "print_contacts.py", *options)
    assert done.returncode == 0, done.stderr
    lines = done.stdout.splitlines()
    assert lines[0] == "test: 2 links"
    assert re.match(r"  pressed +ok +cylinder, 24 x 10 markers, 198 mm", lines[1])
    together = re.fullmatch(rf"-- 1 contacts, {forces.IN_TEXT} together", lines[3])
    assert together and float(together[1]) == forces.PRESS_N
    place = r"at \( *-?[\d.]+, *-?[\d.]+, *-?[\d.]+\) mm +\d+ mm2"
    contact = re.match(rf"pressed +#\d+ +{forces.IN_TEXT} +{place}", lines[4])
    assert contact and float(contact[1]) == forces.PRESS_N
    assert len(lines) == 7


def test_record_and_replay(server: servers.Server, touched: None, library: Path, tmp_path: Path) -> None:
    done = servers.run_example(library, tmp_path, "record_and_replay.py", "--server", server.address, "--seconds", "2")
    assert done.returncode == 0, done.stderr
    assert re.search(r"^  \S+\.mcap  \d+\.\d s  \S*(pressed|idle).* \d+ frames$", done.stdout, re.MULTILINE)
    played = re.findall(rf"^\d{{19}}  pressed +frame \d+   {forces.IN_TEXT}$", done.stdout, re.MULTILINE)
    assert any(float(force_n) == forces.PRESS_N for force_n in played)
    assert done.stdout.splitlines()[-1] == "end of the log"


def test_the_guides_program(server: servers.Server, touched: None, library: Path, tmp_path: Path) -> None:
    page = (servers.EXAMPLES.parents[2] / "docs/guides/program.md").read_text(encoding="utf-8")
    block = re.search(r"```python\n(.*?)```", page, re.DOTALL)
    assert block
    program = block[1].replace("127.0.0.1:50051", server.address).replace('"lower"', '"idle"')
    path = tmp_path / "program.py"
    path.write_text(program, encoding="utf-8")
    done = subprocess.run(
        [sys.executable, str(path)],
        env=servers.environment_of(library, tmp_path),
        capture_output=True,
        text=True,
        timeout=servers.PATIENCE_S,
        check=False,
    )
    assert done.returncode == 0, done.stderr
    assert re.search(r"^(ok|degraded) \d+ \[.*\] \[.*\]$", done.stdout, re.MULTILINE)
    assert re.search(r"^\d{19} \[", done.stdout, re.MULTILINE)


def test_live_plot(server: servers.Server, touched: None, library: Path, tmp_path: Path) -> None:
    options = ("--server", server.address, "--seconds", "1", "--save", "plot.png")
    done = servers.run_example(library, tmp_path, "live_plot.py", *options)
    assert done.returncode == 0, done.stderr
    assert done.stdout == "plot.png written\n"
    assert (tmp_path / "plot.png").read_bytes().startswith(b"\x89PNG")
    assert (tmp_path / "plot.png").stat().st_size > 5000


def test_async_contacts(server: servers.Server, touched: None, library: Path, tmp_path: Path) -> None:
    event = r"event 1: link_status of (pressed|idle)\n"
    contact = rf"pressed +ok +1 contacts  {forces.IN_TEXT}  \d+\.\d ms old\n"
    event_seen = contact_seen = False
    options = ("--server", server.address, "--seconds", str(servers.PATIENCE_S))
    process = subprocess.Popen(
        [sys.executable, str(servers.EXAMPLES / "async_contacts.py"), *options],
        env=servers.environment_of(library, tmp_path),
        stdout=subprocess.PIPE,
        text=True,
    )
    with process:
        assert process.stdout is not None
        for line in process.stdout:
            event_seen = event_seen or re.fullmatch(event, line) is not None
            told = re.fullmatch(contact, line)
            contact_seen = contact_seen or (told is not None and float(told[1]) == forces.PRESS_N)
            if event_seen and contact_seen:
                break
        process.send_signal(signal.SIGINT)
        process.stdout.read()
        assert process.wait(servers.PATIENCE_S) == 0
    assert event_seen and contact_seen


@pytest.mark.parametrize("name", ALL)
def test_without_a_server_one_line_says_so(name: str, library: Path, tmp_path: Path) -> None:
    done = servers.run_example(library, tmp_path, name, "--server", f"unix:{tmp_path}/none")
    assert done.returncode == 1
    assert re.fullmatch(r"no server answers at .*; start taclinkd there .*\n", done.stderr)


def test_credentials_that_cannot_be_used_are_one_line(library: Path, tmp_path: Path) -> None:
    done = servers.run_example(library, tmp_path, "print_contacts.py", "--server", "robot:50051", "--token", "secret")
    assert done.returncode == 1 and done.stderr.endswith("in the clear; use TLS (ca_file)\n")
    done = servers.run_example(library, tmp_path, "print_contacts.py", "--tls-ca", "none.pem")
    assert done.returncode == 1 and done.stderr.startswith("none.pem cannot be read")
