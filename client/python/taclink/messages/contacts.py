"""All contacts of the arm in its base frame, and the torques that they cause on its joints."""

from __future__ import annotations

from dataclasses import dataclass

from taclink.messages.arm import Pose, pose_from
from taclink.messages.arrays import FloatArray, alike, covariance, unknown_vector, vector
from taclink.messages.frame import FrameTimes, times_from
from taclink.names import LinkStatus, PoseValidity, name_of
from taclink.v1 import contacts_pb2


@dataclass(frozen=True, eq=False, kw_only=True, slots=True)
class ArmContact:
    """A contact in the base frame."""

    id: int  # lasts while the contact does; unique over the arm
    link_contact_id: int  # Contact.id
    link: str
    link_index: int
    center_m: FloatArray  # (3,), on the deformed outer surface
    normal: FloatArray  # (3,), unit, out of the skin
    force_n: FloatArray  # (3,), what the world exerts on the skin
    moment_nm: FloatArray  # (3,), of that about the base frame's origin
    force_covariance_n2: FloatArray | None  # (3, 3); None: not known
    center_covariance_m2: FloatArray | None  # (3, 3); without the error of the link's pose
    normal_force_n: float  # pressing in is positive
    is_ring_contact: bool  # as Contact
    area_m2: float
    exposure_utc_ns: int
    validity: PoseValidity


@dataclass(frozen=True, eq=False, kw_only=True, slots=True)
class LinkContacts:
    """How one link stands at its newest frame."""

    link: str
    status: LinkStatus
    sequence: int
    times: FrameTimes
    base_from_link: Pose  # at the exposure of that frame
    validity: PoseValidity
    forces_unknown: bool  # it may be pressed; total and joint torques are without it
    joint_state_distance_s: float | None  # to the nearest joint state used; None: there is none


@dataclass(frozen=True, kw_only=True, slots=True)
class JointTorque:
    """What the contacts, and nothing else, cause on one joint; N m, on prismatic joints N."""

    joint: str
    torque_nm: float
    sigma_nm: float | None  # standard deviation; None: not known


@dataclass(frozen=True, eq=False, kw_only=True, slots=True)
class ArmContacts:
    links: tuple[LinkContacts, ...]
    contacts: tuple[ArmContact, ...]
    total_force_n: FloatArray  # (3,), of links whose forces are known; NaN: those of no link are
    total_moment_nm: FloatArray  # (3,), likewise, about the base frame's origin
    joints: tuple[JointTorque, ...]  # likewise, from the base to the tips; empty: not known, or there are none
    validity: PoseValidity  # the worst of the links with contacts
    sequence: int  # of this stream's messages, from 1
    utc_ns: int  # when the server made it


def _contact_from(message: contacts_pb2.ArmContact) -> ArmContact:
    return alike(
        ArmContact,
        message,
        center_m=vector(message.center_m),
        normal=vector(message.normal),
        force_n=vector(message.wrench.force_n),
        moment_nm=vector(message.wrench.moment_nm),
        force_covariance_n2=covariance(message.force_covariance_n2),
        center_covariance_m2=covariance(message.center_covariance_m2),
        validity=name_of(PoseValidity, message.validity),
    )


def _link_from(message: contacts_pb2.LinkContactsStatus, client_utc_ns: int) -> LinkContacts:
    distance_s = message.joint_state_distance_s
    return alike(
        LinkContacts,
        message,
        status=name_of(LinkStatus, message.status),
        times=times_from(message.times, client_utc_ns),
        base_from_link=pose_from(message.base_from_link),
        validity=name_of(PoseValidity, message.validity),
        joint_state_distance_s=None if distance_s < 0 else distance_s,
    )


def _torques_from(message: contacts_pb2.StreamContactsResponse) -> tuple[JointTorque, ...]:
    known = len(message.joint_torque_sigmas) == len(message.joint_torques)
    sigmas = message.joint_torque_sigmas if known else [None] * len(message.joint_torques)
    return tuple(
        JointTorque(joint=joint, torque_nm=torque, sigma_nm=sigma)
        for joint, torque, sigma in zip(message.joint_names, message.joint_torques, sigmas)
    )


def arm_contacts_from(message: contacts_pb2.StreamContactsResponse, client_utc_ns: int = 0) -> ArmContacts:
    known = message.HasField("total")
    return alike(
        ArmContacts,
        message,
        links=tuple(_link_from(link, client_utc_ns) for link in message.links),
        contacts=tuple(map(_contact_from, message.contacts)),
        total_force_n=vector(message.total.force_n) if known else unknown_vector(),
        total_moment_nm=vector(message.total.moment_nm) if known else unknown_vector(),
        joints=_torques_from(message),
        validity=name_of(PoseValidity, message.validity),
    )
