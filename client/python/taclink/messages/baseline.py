"""Against what displacements and forces are measured."""

from __future__ import annotations

from dataclasses import dataclass

from taclink.messages.arrays import alike, optional
from taclink.names import BaselineOrigin, DriftState, name_of
from taclink.v1 import tactile_pb2, tare_pb2


@dataclass(frozen=True, eq=False, kw_only=True, slots=True)
class Baseline:
    origin: BaselineOrigin
    taken_utc_ns: int  # since 1970-01-01; 0: there is none
    drift_m: float  # how far it has followed the skin since, of the marker that went furthest
    drift_state: DriftState
    calibrated_utc_ns: int  # when the cameras were calibrated that it was taken with; 0: not known
    missing_markers: tuple[int, ...]  # shown by neither camera when it was taken; indices from 0


@dataclass(frozen=True, eq=False, kw_only=True, slots=True)
class LinkTare:
    """What became of one link's tare."""

    link: str
    accepted: bool  # False: the old baseline stays
    reason: str  # why not, and what to do
    forced: bool  # force was needed
    frames: int
    shift_m: float  # against the old baseline, of the marker that is furthest off
    previous_age_s: float


@dataclass(frozen=True, eq=False, kw_only=True, slots=True)
class CalibrationParameter:
    """One parameter of a calibrated camera."""

    camera: str  # "top" or "bottom"
    name: str  # such as "position_z", "tilt_x", "focal_length", "lens_k1"
    unit: str  # "m", "rad", "px", "px^-2", "px^-4" or "1"
    value: float  # of the calibration that the link uses
    fit_sigma: float  # its standard deviation by the fit; 0: the fit does not tell
    mean: float | None  # over the repeats; None: there is one
    standard_deviation: float | None


@dataclass(frozen=True, eq=False, kw_only=True, slots=True)
class CameraShift:
    """By how much a camera has moved since the calibration before."""

    camera: str
    moved_m: float
    turned_rad: float
    is_large: bool  # more than calibrations differ by: mounted again, or knocked


@dataclass(frozen=True, eq=False, kw_only=True, slots=True)
class CalibrationResult:
    """How well a link's cameras fit its rest markers; RMS."""

    markers_used: int  # seen by both cameras
    rms_px: float  # of the reprojection, each axis
    rmse_r_m: float  # of the triangulated markers: from the axis, around it, along it
    rmse_tangential_m: float
    rmse_z_m: float
    file_text: str  # of the calibration file (YAML)
    saved_to: str  # on the server; empty: nowhere
    parameters: tuple[CalibrationParameter, ...]  # of the top camera, then of the bottom one
    repeats: int  # calibrations that were made
    ended_early: str  # why there are fewer than asked for; empty: there are not
    previous_utc_ns: int  # of the calibration in use before; 0: not known
    shifts: tuple[CameraShift, ...]  # of the cameras since that; empty: there was none


def baseline_from(message: tare_pb2.Baseline) -> Baseline:
    return alike(
        Baseline,
        message,
        origin=name_of(BaselineOrigin, message.origin),
        drift_state=name_of(DriftState, message.drift_state),
        missing_markers=tuple(message.missing_markers),
    )


def tares_from(message: tare_pb2.TareResponse) -> tuple[LinkTare, ...]:
    return tuple(alike(LinkTare, link) for link in message.links)


def calibration_from(message: tactile_pb2.CalibrationResult) -> CalibrationResult:
    return alike(
        CalibrationResult,
        message,
        parameters=tuple(
            alike(
                CalibrationParameter,
                one,
                mean=optional(one, "mean"),
                standard_deviation=optional(one, "standard_deviation"),
            )
            for one in message.parameters
        ),
        shifts=tuple(alike(CameraShift, one) for one in message.shifts),
    )
