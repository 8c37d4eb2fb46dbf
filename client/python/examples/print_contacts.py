"""Lists the links of a server, then prints what touches them, in the arm's base frame."""

from __future__ import annotations

import numpy as np
from common import connect, options, run

import taclink


def print_links(arm: taclink.Arm) -> None:
    print(f"{arm.name}: {len(arm.links)} links")
    for link in arm.links:
        model = link.model
        print(
            f"  {link.name:<12} {link.status:<12} {model.name}, {model.paths} x {model.rings} markers, "
            f"{model.length_m * 1e3:.0f} mm  {link.status_reason}"
        )


def print_contacts(arm: taclink.ArmContacts) -> None:
    for contact in arm.contacts:
        force_n = np.linalg.norm(contact.force_n)
        x, y, z = contact.center_m * 1e3
        print(
            f"{contact.link:<12} #{contact.id}  {force_n:5.2f} N  at ({x:6.1f}, {y:6.1f}, {z:6.1f}) mm  "
            f"{contact.area_m2 * 1e6:4.0f} mm2"
        )


def main() -> None:
    parser = options(__doc__)
    parser.add_argument("--rate", type=float, default=2, help="lists a second, Hz (%(default)s)")
    parser.add_argument("--count", type=int, default=0, help="end after so many lists (0: never)")
    arguments = parser.parse_args()
    with connect(arguments) as client:
        print_links(client.arm())
        for contacts in client.contacts(max_rate_hz=arguments.rate):
            total_n = np.linalg.norm(contacts.total_force_n)
            total = "sum not known" if np.isnan(total_n) else f"{total_n:.2f} N together"
            unknown = [link.link for link in contacts.links if link.forces_unknown]
            beside = f", without {', '.join(unknown)}: not known" if unknown else ""
            print(f"-- {len(contacts.contacts)} contacts, {total}{beside}", flush=True)
            print_contacts(contacts)
            if contacts.sequence == arguments.count:
                break


run(main)
