"""The arm: its links, what they are, where they sit and how they do."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from taclink.messages.arrays import FloatArray, alike, numbers, optional, rows, vector
from taclink.messages.baseline import Baseline, baseline_from
from taclink.messages.force_level import ForceLevelState, force_level_state_from
from taclink.messages.pressure import Regulator, regulator_from
from taclink.names import JointKind, LinkStatus, PoseValidity, SourceKind, Supervision, name_of
from taclink.v1 import arm_pb2, camera_pb2, geometry_pb2, joints_pb2


@dataclass(frozen=True, eq=False, kw_only=True, slots=True)
class Pose:
    """p_target = rotation * p_source + translation."""

    translation_m: FloatArray  # (3,)
    rotation_xyzw: FloatArray  # (4,), unit quaternion

    @property
    def rotation(self) -> FloatArray:
        """(3, 3)."""
        x, y, z, w = self.rotation_xyzw
        return np.array(
            [
                [1 - 2 * (y * y + z * z), 2 * (x * y - z * w), 2 * (x * z + y * w)],
                [2 * (x * y + z * w), 1 - 2 * (x * x + z * z), 2 * (y * z - x * w)],
                [2 * (x * z - y * w), 2 * (y * z + x * w), 1 - 2 * (x * x + y * y)],
            ]
        )

    @property
    def matrix(self) -> FloatArray:
        """(4, 4), homogeneous."""
        out = np.eye(4)
        out[:3, :3] = self.rotation
        out[:3, 3] = self.translation_m
        return out

    def of_points(self, points_m: FloatArray) -> FloatArray:
        """Points (3,) or (n, 3) of the source frame in the target frame."""
        moved: FloatArray = points_m @ self.rotation.T + self.translation_m
        return moved

    def of_directions(self, directions: FloatArray) -> FloatArray:
        """Forces, normals, displacements: (3,) or (n, 3)."""
        turned: FloatArray = directions @ self.rotation.T
        return turned


@dataclass(frozen=True, eq=False, kw_only=True, slots=True)
class LinkModel:
    """A type of link. Per-marker data, here and in Frame, is ring by ring: index = ring * paths + path."""

    name: str
    description: str
    length_m: float  # of the skin, between the clamped ends
    thickness_m: float
    tube_radius_m: float  # 0: no tube
    youngs_modulus_pa: float
    poisson_ratio: float
    paths: int
    rings: int
    first_path_angle_rad: float  # path i lies at this + i 2 pi / paths, from +x towards +y
    ring_z_m: FloatArray  # (rings,)
    marker_diameter_m: float
    rest_positions_m: FloatArray  # (markers, 3), on the undeformed skin
    profile_z_m: FloatArray  # (k,); outer surface at rest: radius over z
    profile_radius_m: FloatArray  # (k,)

    @property
    def markers(self) -> int:
        return self.paths * self.rings


@dataclass(frozen=True, eq=False, kw_only=True, slots=True)
class Source:
    """Where a link's pictures come from."""

    kind: SourceKind
    description: str
    width_px: int  # 0: not known yet
    height_px: int
    frame_rate_hz: float  # as promised; what arrives is LinkStatistics.rate_hz


@dataclass(frozen=True, eq=False, kw_only=True, slots=True)
class LinkStatistics:
    """Counts are since the server started."""

    rate_hz: float  # frames solved, over the last 2 s
    latency_p50_s: float  # exposure to hand-over, last 300 frames; 0: none yet
    latency_p99_s: float
    frame_age_s: float  # of the newest frame, when the server answered; 0: there is none
    frames: int
    frames_skipped: int  # exposed but not solved
    pairs_skipped: int  # of these, because a newer pair had come
    source_restarts: int
    contacts: int  # in the newest frame
    worker_restarts: int
    stage_overruns: int
    workers_abandoned: int
    last_failure: str  # empty: none


@dataclass(frozen=True, eq=False, kw_only=True, slots=True)
class Camera:
    """Counts are since the server started."""

    name: str  # "top" or "bottom"
    configured: str
    device: str  # empty: not open
    format: str  # likewise
    trouble: str  # why it gives no pictures; empty: it does
    rate_hz: float
    pictures: int
    lost: int
    damaged: int
    undecodable: int
    unpaired: int
    stamped_on_arrival: int
    automatic_exposure: bool | None  # None: no such control, or not open
    exposure_s: float | None  # None also while the camera decides
    gain: int | None  # camera's own units


@dataclass(frozen=True, eq=False, kw_only=True, slots=True)
class Link:
    name: str
    index: int
    model: LinkModel
    base_from_link: Pose  # now
    pose_validity: PoseValidity
    frame: str  # link of the URDF that it is fixed to; empty: the base
    source: Source
    status: LinkStatus
    status_reason: str  # empty when the status is OK
    statistics: LinkStatistics
    cameras: tuple[Camera, ...]  # top, bottom; none: the source has no cameras
    force_levels: tuple[ForceLevelState, ...]  # of the whole link, then of its regions
    baseline: Baseline
    supervision: Supervision
    supervision_reason: str  # empty while the worker runs
    regulator: Regulator | None  # None: no regulator sets its pressure


@dataclass(frozen=True, eq=False, kw_only=True, slots=True)
class Joint:
    """Of the arm's URDF, moving by itself. rad and rad/s; prismatic: m and m/s."""

    name: str
    kind: JointKind
    lower: float | None  # None: not limited
    upper: float | None
    position: float | None  # now; None: the server was told none
    position_age_s: float


@dataclass(frozen=True, eq=False, kw_only=True, slots=True)
class Arm:
    name: str
    server_version: str
    links: tuple[Link, ...]
    base_frame: str  # link of the URDF; empty: there is no URDF
    joints: tuple[Joint, ...]  # from the base to the tips

    def link(self, name: str) -> Link:
        """Errors: KeyError."""
        for link in self.links:
            if link.name == name:
                return link
        raise KeyError(f"no link '{name}'; there are: {', '.join(link.name for link in self.links)}")


def pose_from(message: geometry_pb2.Pose) -> Pose:
    turn = message.rotation
    return Pose(
        translation_m=vector(message.translation_m),
        rotation_xyzw=numbers((turn.x, turn.y, turn.z, turn.w)),
    )


def _model_from(message: arm_pb2.LinkModel) -> LinkModel:
    return alike(
        LinkModel,
        message,
        youngs_modulus_pa=message.material.youngs_modulus_pa,
        poisson_ratio=message.material.poisson_ratio,
        paths=message.markers.paths,
        rings=message.markers.rings,
        first_path_angle_rad=message.markers.first_path_angle_rad,
        ring_z_m=numbers(message.markers.ring_z_m),
        marker_diameter_m=message.markers.diameter_m,
        rest_positions_m=rows(message.markers.rest_positions_m, 3),
        profile_z_m=numbers(message.profile_z_m),
        profile_radius_m=numbers(message.profile_radius_m),
    )


def _camera_from(message: camera_pb2.Camera) -> Camera:
    return alike(
        Camera,
        message,
        automatic_exposure=optional(message, "automatic_exposure"),
        exposure_s=optional(message, "exposure_s"),
        gain=optional(message, "gain"),
    )


def _link_from(message: arm_pb2.Link) -> Link:
    return alike(
        Link,
        message,
        model=_model_from(message.model),
        base_from_link=pose_from(message.base_from_link),
        pose_validity=name_of(PoseValidity, message.pose_validity),
        source=alike(Source, message.source, kind=name_of(SourceKind, message.source.kind)),
        status=name_of(LinkStatus, message.status),
        statistics=alike(LinkStatistics, message.statistics),
        cameras=tuple(map(_camera_from, message.cameras)),
        force_levels=tuple(map(force_level_state_from, message.force_levels)),
        baseline=baseline_from(message.baseline),
        supervision=name_of(Supervision, message.supervision),
        regulator=regulator_from(message.regulator) if message.HasField("regulator") else None,
    )


def _joint_from(message: joints_pb2.Joint) -> Joint:
    return alike(
        Joint,
        message,
        kind=name_of(JointKind, message.kind),
        lower=optional(message, "lower"),
        upper=optional(message, "upper"),
        position=optional(message, "position"),
    )


def arm_from(message: arm_pb2.Arm) -> Arm:
    return alike(
        Arm,
        message,
        links=tuple(map(_link_from, message.links)),
        joints=tuple(map(_joint_from, message.joints)),
    )
