"""All that one moment told about one link."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from taclink.messages.arrays import (
    ByteArray,
    FloatArray,
    IntArray,
    alike,
    covariance,
    covariances,
    numbers,
    optional,
    rows,
    small_numbers,
    unknown_vector,
    vector,
    whole_numbers,
)
from taclink.messages.baseline import Baseline, baseline_from
from taclink.names import (
    AcquireReason,
    AttitudeOrigin,
    Detail,
    ForceModel,
    LinkStatus,
    PressureOrigin,
    Reason,
    TrackingMode,
    name_of,
)
from taclink.v1 import frame_pb2, pressure_pb2, tactile_pb2


@dataclass(frozen=True, eq=False, kw_only=True, slots=True)
class Contact:
    """A connected region of the skin that something pushes on; link frame."""

    id: int  # lasts while the contact does
    center_m: FloatArray  # (3,), on the deformed outer surface
    normal: FloatArray  # (3,), unit, away from the axis
    force_n: FloatArray  # (3,), what the world exerts on the skin
    force_covariance_n2: FloatArray | None  # (3, 3); None: not known
    center_covariance_m2: FloatArray | None  # (3, 3); likewise
    normal_force_n: float  # integral of the inward load; nonzero also for a ring contact
    is_ring_contact: bool  # presses evenly around the whole circumference; force_n is about zero
    area_m2: float
    markers: IntArray  # (k,), indices of the loaded markers
    moment_nm: FloatArray  # (3,), of the load about the link frame's origin
    peak_pressure_pa: float
    major_axis_m: FloatArray  # (3,), as long as the load's standard deviation along it
    minor_axis_m: FloatArray  # (3,)
    outline_m: FloatArray  # (k, 3), polygon on the deformed skin; no rows below detail geometry

    @property
    def magnitude_n(self) -> float:
        """How strongly it acts on the skin: normal_force_n or |force_n|, the larger one, N.

        What presses from opposite sides cancels in the resultant; what drags on the skin is not in the normal force.
        """
        return max(self.normal_force_n, float(np.linalg.norm(self.force_n)))


@dataclass(frozen=True, kw_only=True, slots=True)
class StatusReason:
    """Why a frame is worse than it could be."""

    reason: Reason
    id: str  # its name, also of one that only a newer server knows
    text: str  # for people, with what to do
    value: float | None  # the reason's number; None: it has none
    limit: float | None  # where it begins to be told
    unit: str  # "m", "Pa", "s"; empty: a number of markers, or a ratio


@dataclass(frozen=True, kw_only=True, slots=True)
class PressureEstimate:
    """Gauge pressure that the skin's shape and the sensor tell together."""

    pressure_pa: float
    sigma_pa: float  # standard deviation


@dataclass(frozen=True, eq=False, kw_only=True, slots=True)
class SpecificForceEstimate:
    """Gravity less the link's acceleration, link frame: what the skin's shape and the measured attitude tell together."""

    specific_force_mps2: FloatArray  # (3,)
    covariance_m2_s4: FloatArray | None  # (3, 3); None: not known


@dataclass(frozen=True, kw_only=True, slots=True)
class FrameTimes:
    """ns; 0: has not happened. utc: since 1970-01-01; all else: the server's CLOCK_MONOTONIC."""

    exposure_utc_ns: int
    exposure_ns: int
    received_ns: int
    tracked_ns: int
    solved_ns: int
    published_ns: int
    client_utc_ns: int  # this client had it; 0: it comes from a log


@dataclass(frozen=True, kw_only=True, slots=True)
class StageTimes:
    """How long each stage took, s; 0: did not run."""

    decode_s: float
    detect_s: float
    register_s: float
    reconstruct_s: float
    force_s: float


@dataclass(frozen=True, kw_only=True, slots=True)
class CameraCounts:
    """What one camera's picture gave."""

    detections: int
    labelled: int
    share_read: float  # of the picture's pixels, 0 to 1
    verified: int
    measured: int
    searched: int
    found: int
    dropped: int
    contrast: float | None  # of the markers, by what it was in the rest images; None: not known


@dataclass(frozen=True, kw_only=True, slots=True)
class PressureReport:
    """How the pressure inside a skin is known."""

    origin: PressureOrigin
    assumed: bool  # configured, or told by nobody: not measured
    stale: bool  # the sensor's newest reading is too old, or there is none
    pressure_pa: float  # gauge
    age_s: float | None  # from the reading to the exposure; None: there is no reading
    trouble: str  # empty: nothing


@dataclass(frozen=True, eq=False, kw_only=True, slots=True)
class SpecificForceReport:
    """How the specific force (gravity less the link's acceleration) is known; link frame."""

    specific_force_mps2: FloatArray  # (3,)
    covariance_m2_s4: FloatArray | None  # (3, 3); None: it counts as exact
    origin: AttitudeOrigin
    trouble: str  # empty: nothing


@dataclass(frozen=True, eq=False, kw_only=True, slots=True)
class AppliedContact:
    """A rigid body, or one piece of it, that presses on a simulated skin; link frame."""

    body_id: int  # as in press(); 0: of the link's scene
    center_m: FloatArray  # (3,), of pressure, on the deformed outer surface
    normal: FloatArray  # (3,), unit, away from the axis
    force_n: FloatArray  # (3,), what it exerts on the skin
    depth_m: float  # of its foremost point, along the normal from the undeformed surface


@dataclass(frozen=True, eq=False, kw_only=True, slots=True)
class SimulationReport:
    """What is true of a simulated link. Nothing is estimated from it."""

    contacts: tuple[AppliedContact, ...]
    trouble: str  # why a user's bodies do not go on or were taken off; empty: nothing


@dataclass(frozen=True, eq=False, kw_only=True, slots=True)
class Frame:
    """Vectors are in the link frame; arrays by marker have no rows below their detail, or where nothing is measured."""

    link: str
    link_index: int
    sequence: int  # counts exposures of this link's source
    # Exposures of the link between its frame before in this stream and this one: not solved, dropped, or left out
    # as the stream asked for. None: there is no frame before, or the count has begun anew.
    gap: int | None
    times: FrameTimes
    status: LinkStatus
    status_reason: str  # empty when the status is OK
    status_reasons: tuple[StatusReason, ...]  # all of them, the gravest first
    detail: Detail
    pressure_pa: float | None  # gauge; None: not measured
    pressure: PressureReport | None  # None: a frame without a picture
    pressure_estimate: PressureEstimate | None  # None: nothing was estimated
    specific_force: SpecificForceReport | None  # as it was measured; None: the link never moves
    specific_force_estimate: SpecificForceEstimate | None  # None: likewise, or the attitude counts as exact
    simulation: SimulationReport | None  # None: the link is not simulated
    markers_seen: int
    markers_inferred: int
    contacts: tuple[Contact, ...]
    total_force_n: FloatArray  # (3,); NaN: no forces are known, and contacts is empty (see status_reason)
    force_model: ForceModel
    baseline_age_s: float
    baseline: Baseline
    stage_times: StageTimes
    cameras: tuple[CameraCounts, ...]  # top, bottom
    tracking_mode: TrackingMode
    acquire_reason: AcquireReason
    labels_rejected: int
    # A body that presses less may not be found, N; of all markers the largest. None: no forces are known, or
    # their model (literal) tells none.
    detection_limit_n: float | None
    # The same of what presses alike all around at one place along the link: its sum, where it shows least.
    detection_limit_around_n: float | None
    # RMS of what the forces do not explain, in standard deviations. None: no forces are known.
    force_residual: float | None
    # How far cameras that have moved or changed since the baseline would put markers off, of the marker that
    # they put off most; taken off shape and forces. None: no forces are known, or an older version's log.
    camera_shift_m: float | None
    unchanged: bool  # within the stream's deadband
    replayed: bool  # from a log: the times are those of then
    # Detail geometry.
    positions_m: FloatArray  # (markers, 3), on the deformed skin
    # Detail full.
    displacements_m: FloatArray  # (markers, 3), from the baseline
    displacement_covariances_m2: FloatArray  # (markers, 3, 3)
    nodal_forces_n: FloatArray  # (markers, 3)
    nodal_force_sigmas_n: FloatArray  # (markers,), along the normal; 0 where the force is 0
    marker_sources: ByteArray  # (markers,), of MarkerSource
    detection_limits_n: FloatArray  # (markers,), as detection_limit_n
    force_converged: bool

    @property
    def total_magnitude_n(self) -> float:
        """Sum of the contacts' magnitudes, N; NaN: no forces are known."""
        if np.isnan(self.total_force_n).any():
            return math.nan
        return sum(contact.magnitude_n for contact in self.contacts)

    @property
    def latency_s(self) -> float | None:
        """From exposure to this client; right as far as both machines' clocks agree. None: not known."""
        return latency_of(self.times.exposure_utc_ns, self.times.client_utc_ns, self.replayed)


@dataclass(frozen=True, kw_only=True, slots=True)
class StreamCounts:
    """Frames of a link since the stream began, as the server counts them."""

    link: str
    frames_sent: int
    frames_dropped: int  # because this client was too slow
    frames_dropped_for_bytes: int  # of these, because of the bytes that waited, not their number
    frames_unchanged: int  # left out because of the deadband


def latency_of(exposure_utc_ns: int, client_utc_ns: int, replayed: bool) -> float | None:
    if exposure_utc_ns == 0 or client_utc_ns == 0 or replayed:
        return None
    return (client_utc_ns - exposure_utc_ns) * 1e-9


def times_from(message: frame_pb2.FrameTimes, client_utc_ns: int) -> FrameTimes:
    return alike(FrameTimes, message, client_utc_ns=client_utc_ns)


def _specific_force_from(message: frame_pb2.SpecificForceEstimate) -> SpecificForceEstimate:
    return SpecificForceEstimate(
        specific_force_mps2=vector(message.specific_force_mps2),
        covariance_m2_s4=covariance(message.covariance_m2_s4),
    )


def _specific_force_report_from(message: frame_pb2.SpecificForceReport) -> SpecificForceReport:
    return SpecificForceReport(
        specific_force_mps2=vector(message.specific_force_mps2),
        covariance_m2_s4=covariance(message.covariance_m2_s4),
        origin=name_of(AttitudeOrigin, message.origin),
        trouble=message.trouble,
    )


def _simulation_from(message: frame_pb2.SimulationReport) -> SimulationReport:
    contacts = tuple(
        AppliedContact(
            body_id=each.body_id,
            center_m=vector(each.center_m),
            normal=vector(each.normal),
            force_n=vector(each.force_n),
            depth_m=each.depth_m,
        )
        for each in message.contacts
    )
    return SimulationReport(contacts=contacts, trouble=message.trouble)


def _contact_from(message: frame_pb2.Contact) -> Contact:
    return alike(
        Contact,
        message,
        center_m=vector(message.center_m),
        normal=vector(message.normal),
        force_n=vector(message.force_n),
        force_covariance_n2=covariance(message.force_covariance_n2),
        center_covariance_m2=covariance(message.center_covariance_m2),
        markers=whole_numbers(message.markers),
        moment_nm=vector(message.moment_nm),
        major_axis_m=vector(message.major_axis_m),
        minor_axis_m=vector(message.minor_axis_m),
        outline_m=rows(message.outline_m, 3),
    )


def _pressure_from(message: pressure_pb2.PressureReport) -> PressureReport:
    return alike(
        PressureReport,
        message,
        origin=name_of(PressureOrigin, message.origin),
        age_s=optional(message, "age_s"),
    )


_REASONS = {reason.value for reason in Reason}


def _reason_from(message: frame_pb2.StatusReason) -> StatusReason:
    return alike(
        StatusReason,
        message,
        # All versions send the name.
        reason=Reason(message.id) if message.id in _REASONS else Reason.UNKNOWN,
        value=optional(message, "value"),
        limit=optional(message, "limit"),
    )


def frame_from(message: frame_pb2.LinkFrame, client_utc_ns: int = 0, gap: int | None = None) -> Frame:
    return alike(
        Frame,
        message,
        gap=gap,
        times=times_from(message.times, client_utc_ns),
        status=name_of(LinkStatus, message.status),
        detail=name_of(Detail, message.detail),
        pressure_pa=optional(message, "pressure_pa"),
        pressure=_pressure_from(message.pressure) if message.HasField("pressure") else None,
        status_reasons=tuple(map(_reason_from, message.status_reasons)),
        pressure_estimate=alike(PressureEstimate, message.pressure_estimate)
        if message.HasField("pressure_estimate")
        else None,
        specific_force=_specific_force_report_from(message.specific_force)
        if message.HasField("specific_force")
        else None,
        specific_force_estimate=_specific_force_from(message.specific_force_estimate)
        if message.HasField("specific_force_estimate")
        else None,
        simulation=_simulation_from(message.simulation) if message.HasField("simulation") else None,
        contacts=tuple(map(_contact_from, message.contacts)),
        total_force_n=vector(message.total_force_n)
        if message.HasField("total_force_n")
        else unknown_vector(),
        force_model=name_of(ForceModel, message.force_model),
        baseline=baseline_from(message.baseline),
        stage_times=alike(StageTimes, message.stage_times),
        cameras=tuple(
            alike(CameraCounts, camera, contrast=optional(camera, "contrast")) for camera in message.cameras
        ),
        tracking_mode=name_of(TrackingMode, message.tracking_mode),
        acquire_reason=name_of(AcquireReason, message.acquire_reason),
        detection_limit_n=optional(message, "detection_limit_n"),
        detection_limit_around_n=optional(message, "detection_limit_around_n"),
        force_residual=optional(message, "force_residual"),
        camera_shift_m=optional(message, "camera_shift_m"),
        positions_m=rows(message.positions_m, 3),
        displacements_m=rows(message.displacements_m, 3),
        displacement_covariances_m2=covariances(message.displacement_covariances_m2),
        nodal_forces_n=rows(message.nodal_forces_n, 3),
        nodal_force_sigmas_n=numbers(message.nodal_force_sigmas_n),
        marker_sources=small_numbers(message.marker_sources),
        detection_limits_n=numbers(message.detection_limits_n),
        force_converged=not message.force_not_converged,
    )


def counts_from(message: tactile_pb2.StreamStatus) -> tuple[StreamCounts, ...]:
    return tuple(alike(StreamCounts, link) for link in message.links)
