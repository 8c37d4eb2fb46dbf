"""Servers that ask who calls: tokens, TLS, certificates of clients."""

from __future__ import annotations

import asyncio
import subprocess
from pathlib import Path
from typing import Iterator

import pytest
import server as servers

import taclink
import taclink.aio

SANS = "subjectAltName=IP:127.0.0.1,DNS:localhost"


def openssl(*arguments: str) -> None:
    subprocess.run(["openssl", *arguments], check=True, capture_output=True, timeout=servers.PATIENCE_S)


def authority(folder: Path, name: str) -> None:
    """NAME.pem and NAME.key: a certificate that signs others."""
    key, certificate = str(folder / f"{name}.key"), str(folder / f"{name}.pem")
    curve = ("-newkey", "ec", "-pkeyopt", "ec_paramgen_curve:prime256v1", "-nodes")
    openssl("req", "-x509", *curve, "-keyout", key, "-out", certificate, "-days", "2", "-subj", f"/CN={name}")


def issue(folder: Path, name: str, signer: str) -> None:
    """NAME.pem and NAME.key, signed."""
    key, request = str(folder / f"{name}.key"), str(folder / f"{name}.csr")
    curve = ("-newkey", "ec", "-pkeyopt", "ec_paramgen_curve:prime256v1", "-nodes")
    openssl("req", *curve, "-keyout", key, "-out", request, "-subj", f"/CN={name}")
    (folder / "sans").write_text(SANS)
    by = ("-CA", str(folder / f"{signer}.pem"), "-CAkey", str(folder / f"{signer}.key"), "-CAcreateserial")
    openssl("x509", "-req", "-in", request, *by, "-days", "2", "-extfile", str(folder / "sans"),
            "-out", str(folder / f"{name}.pem"))  # fmt: skip
    (folder / f"{name}.key").chmod(0o600)


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    made = tmp_path_factory.mktemp("security")
    authority(made, "ca")
    authority(made, "stranger")
    issue(made, "server", "ca")
    issue(made, "robot", "ca")
    return made


def make_token(folder: Path, name: str, role: str) -> str:
    made = subprocess.run(
        [str(servers.TACLINK), "token", "new", name, "--role", role], check=True, capture_output=True, text=True
    )
    (folder / "tokens").touch(mode=0o600)
    with open(folder / "tokens", "a") as tokens:
        tokens.write(made.stdout)
    return made.stderr.strip().rpartition(" ")[2]


@pytest.fixture(scope="module")
def tokens(folder: Path) -> dict[str, str]:
    return {role: make_token(folder, role, role) for role in ("viewer", "operator")}


def config(more: str) -> str:
    link = servers.links(servers.link("skin", "rest"))
    return f"{servers.HEAD}security: {{certificate: server.pem, key: server.key, {more}}}\n{link}"


@pytest.fixture(scope="module")
def guarded(folder: Path, tokens: dict[str, str]) -> Iterator[servers.Server]:
    """By TLS and tokens."""
    running = servers.Server(folder, config("tokens: tokens"))
    yield running
    running.stop()


def test_tokens_say_who_may_do_what(guarded: servers.Server, folder: Path, tokens: dict[str, str]) -> None:
    def connect(token: str | None) -> taclink.Client:
        return taclink.Client(guarded.address, token=token, ca_file=folder / "ca.pem", timeout=servers.PATIENCE_S)

    with connect(tokens["viewer"]) as client:
        assert client.arm().name == "test" and next(client.frames()).link == "skin"
        assert client.caller() == taclink.Caller(name="viewer", role=taclink.Role.VIEWER, tokens=True)
        with pytest.raises(taclink.PermissionDenied, match="'viewer' is a viewer.*for operators"):
            client.tare(force=True)
        joints = client.update_joint_states()
        with pytest.raises(taclink.PermissionDenied):
            joints.finish()
    with connect(tokens["operator"]) as client:
        client.set_thresholds("skin", warning_n=1)
        assert client.caller().role == "operator"
    with connect(None) as client:
        assert client.caller().role == taclink.Role.NOBODY
        with pytest.raises(taclink.Unauthenticated, match="asks for a token.*token="):
            client.arm()
        with pytest.raises(taclink.Unauthenticated, match="asks for a token"):
            client.frames()
    with connect("0" * 64) as client, pytest.raises(taclink.Unauthenticated, match="not known"):
        client.contacts()


def test_tls_knows_the_server(guarded: servers.Server, folder: Path, tokens: dict[str, str]) -> None:
    for ca_file, advice in ((None, "TLS needs ca_file"), (folder / "stranger.pem", "certificate.*check ca_file")):
        with taclink.Client(
            guarded.address, token=tokens["viewer"], ca_file=ca_file, timeout=servers.PATIENCE_S
        ) as client, pytest.raises(taclink.Unavailable, match=advice):
            client.arm()


def test_tokens_go_with_asyncio(guarded: servers.Server, folder: Path, tokens: dict[str, str]) -> None:
    async def ask() -> None:
        async with taclink.aio.Client(
            guarded.address, token=tokens["viewer"], ca_file=folder / "ca.pem", timeout=servers.PATIENCE_S
        ) as client:
            assert (await client.caller()).name == "viewer"
            async for frame in client.frames():
                assert frame.link == "skin"
                break
            with pytest.raises(taclink.PermissionDenied, match="for operators"):
                await client.restart_link("skin")
        async with taclink.aio.Client(guarded.address, ca_file=folder / "ca.pem", timeout=servers.PATIENCE_S) as client:
            with pytest.raises(taclink.Unauthenticated, match="asks for a token"):
                async with client.frames():
                    pass

    asyncio.run(ask())


def test_a_server_may_ask_for_certificates(folder: Path, tmp_path: Path) -> None:
    for name in ("server.pem", "server.key", "ca.pem"):
        (tmp_path / name).write_bytes((folder / name).read_bytes())
    (tmp_path / "server.key").chmod(0o600)
    mutual = servers.Server(tmp_path, config("client_ca: ca.pem"))
    try:
        with taclink.Client(
            mutual.address,
            ca_file=folder / "ca.pem",
            certificate_file=folder / "robot.pem",
            key_file=folder / "robot.key",
            timeout=servers.PATIENCE_S,
        ) as client:
            assert client.arm().name == "test"
        with taclink.Client(mutual.address, ca_file=folder / "ca.pem", timeout=servers.PATIENCE_S) as client:
            with pytest.raises(taclink.Unavailable):
                client.arm()
    finally:
        mutual.stop()


def test_examples_take_tokens_and_tls(
    guarded: servers.Server, folder: Path, tokens: dict[str, str], library: Path, tmp_path: Path
) -> None:
    options = ("--server", guarded.address, "--token", tokens["viewer"], "--tls-ca", str(folder / "ca.pem"))
    done = servers.run_example(library, tmp_path, "print_contacts.py", *options, "--count", "1")
    assert done.returncode == 0 and done.stdout.startswith("test: 1 links\n"), done.stderr
