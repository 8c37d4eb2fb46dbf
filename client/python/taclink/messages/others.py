"""Pictures, summaries and who the caller is."""

from __future__ import annotations

from dataclasses import dataclass

from taclink.messages.arrays import FloatArray, IntArray, alike, numbers, rows, whole_numbers
from taclink.names import LinkStatus, Role, name_of
from taclink.v1 import attitude_pb2, joints_pb2, operations_pb2, pressure_pb2, preview_pb2, recording_pb2


@dataclass(frozen=True, eq=False, kw_only=True, slots=True)
class Picture:
    """One camera's picture, and the markers that were found in it."""

    camera: str  # "top" or "bottom"
    jpeg: bytes  # empty: see why_missing
    why_missing: str
    width_px: int
    height_px: int
    markers: IntArray  # (k,), index of each marker found
    centers_px: FloatArray  # (k, 2); the middle of the first pixel is at 0, 0
    center_sigmas_px: FloatArray  # (k,), standard deviation along an axis


@dataclass(frozen=True, eq=False, kw_only=True, slots=True)
class Preview:
    """The pair of pictures of one frame."""

    link: str
    sequence: int  # Frame.sequence
    exposure_utc_ns: int
    status: LinkStatus
    pictures: tuple[Picture, ...]  # top, bottom


@dataclass(frozen=True, eq=False, kw_only=True, slots=True)
class ReplayPictures:
    """What a link's cameras saw, from a log; without markers."""

    sequence: int  # the low 32 bits of Frame.sequence
    exposure_utc_ns: int
    pictures: tuple[Picture, ...]  # top, bottom


@dataclass(frozen=True, kw_only=True, slots=True)
class JointStateSummary:
    accepted: int  # messages of which at least one joint's state was taken
    refused: int  # without fault and without use
    first_refusal: str  # empty: none was


@dataclass(frozen=True, kw_only=True, slots=True)
class PressureSummary:
    accepted: int
    refused: int  # not newer than one that is known


@dataclass(frozen=True, kw_only=True, slots=True)
class AttitudeSummary:
    accepted: int
    refused: int  # not newer than one that is known


@dataclass(frozen=True, kw_only=True, slots=True)
class Caller:
    """Who the server takes this client for."""

    name: str  # of the token; empty: none that is known
    role: Role
    tokens: bool  # the server knows people by tokens


def _picture_from(message: preview_pb2.PreviewPicture) -> Picture:
    return alike(
        Picture,
        message,
        markers=whole_numbers(message.markers),
        centers_px=rows(message.centers_px, 2),
        center_sigmas_px=numbers(message.center_sigmas_px),
    )


def preview_from(message: preview_pb2.StreamPreviewResponse) -> Preview:
    return alike(
        Preview,
        message,
        status=name_of(LinkStatus, message.status),
        pictures=tuple(map(_picture_from, message.pictures)),
    )


def replay_pictures_from(message: recording_pb2.GetReplayPicturesResponse) -> ReplayPictures:
    return alike(ReplayPictures, message, pictures=tuple(map(_picture_from, message.pictures)))


def joint_summary_from(message: joints_pb2.UpdateJointStatesResponse) -> JointStateSummary:
    return alike(JointStateSummary, message)


def pressure_summary_from(message: pressure_pb2.UpdatePressureResponse) -> PressureSummary:
    return alike(PressureSummary, message)


def attitude_summary_from(message: attitude_pb2.UpdateAttitudeResponse) -> AttitudeSummary:
    return alike(AttitudeSummary, message)


def caller_from(message: operations_pb2.GetCallerResponse) -> Caller:
    return alike(Caller, message, role=name_of(Role, message.role))
