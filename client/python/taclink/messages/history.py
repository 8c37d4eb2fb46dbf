"""How strongly links were pressed in the last minutes."""

from __future__ import annotations

from dataclasses import dataclass

from taclink.messages.arrays import FloatArray, IntArray, numbers, whole_numbers
from taclink.v1 import history_pb2


@dataclass(frozen=True, eq=False, kw_only=True, slots=True)
class ContactForceHistory:
    """One contact."""

    id: int  # Contact.id
    samples: IntArray  # (k,), which samples of the link have it
    magnitude_n: FloatArray  # (k,), N; see Contact


@dataclass(frozen=True, eq=False, kw_only=True, slots=True)
class ForceHistory:
    """One link: of each 0.1 s in which a frame came, the frame with the largest sum of contact magnitudes."""

    link: str
    exposure_utc_ns: IntArray  # (n,), oldest first
    total_magnitude_n: FloatArray  # (n,), N, sum of the contacts' magnitudes; NaN: forces were not known
    contacts: tuple[ContactForceHistory, ...]


def _contact_from(message: history_pb2.ContactForceHistory) -> ContactForceHistory:
    return ContactForceHistory(
        id=message.id, samples=whole_numbers(message.samples), magnitude_n=numbers(message.magnitude_n)
    )


def histories_from(message: history_pb2.GetForceHistoryResponse) -> tuple[ForceHistory, ...]:
    return tuple(
        ForceHistory(
            link=link.link,
            exposure_utc_ns=whole_numbers(link.exposure_utc_ns),
            total_magnitude_n=numbers(link.total_magnitude_n),
            contacts=tuple(map(_contact_from, link.contacts)),
        )
        for link in message.links
    )
