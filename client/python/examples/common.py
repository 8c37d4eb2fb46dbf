"""What all examples share: their options, and one line where something fails."""

from __future__ import annotations

import argparse
import os
import sys
from collections.abc import Callable

import taclink


def options(description: str | None) -> argparse.ArgumentParser:
    parser = argparse.ArgumentParser(description=description)
    parser.add_argument(
        "--server",
        default=os.environ.get("TACLINK_SERVER", taclink.DEFAULT_ADDRESS),
        help="address of the server, host:port (%(default)s)",
    )
    parser.add_argument(
        "--token", default=os.environ.get("TACLINK_TOKEN"), help="that the server knows (better in TACLINK_TOKEN)"
    )
    parser.add_argument(
        "--tls-ca",
        default=os.environ.get("TACLINK_TLS_CA"),
        help="certificates that the server's must be signed by: TLS",
    )
    return parser


def connect(arguments: argparse.Namespace) -> taclink.Client:
    return taclink.Client(arguments.server, token=arguments.token, ca_file=arguments.tls_ca)


def run(main: Callable[[], None]) -> None:
    try:
        main()
    except (taclink.TaclinkError, OSError) as error:
        sys.exit(str(error))  # with status 1
    except KeyboardInterrupt:
        pass
