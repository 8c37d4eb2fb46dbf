"""What the protocol enumerates. Members are texts: LinkStatus.OK == "ok"."""

from __future__ import annotations

from collections.abc import Sequence
from enum import Enum, IntEnum
from functools import lru_cache
from typing import Any, TypeVar

from taclink.errors import InvalidArgument


class Name(str, Enum):
    """Members stand in the order of the protocol's numbers, from 0."""

    def __str__(self) -> str:
        return str(self.value)


N = TypeVar("N", bound=Name)


@lru_cache(maxsize=None)
def _members(kind: type[N]) -> Sequence[N]:
    return tuple(kind)


def name_of(kind: type[N], number: int) -> N:
    """The first member stands also for what a newer server says."""
    members = _members(kind)
    return members[number] if 0 <= number < len(members) else members[0]


def number_of(kind: type[N], text: str, what: str) -> Any:
    """As the protocol has it. Errors: InvalidArgument, with the names that there are."""
    known = {
        member.value: number
        for number, member in enumerate(_members(kind))
        if member.value != "unknown" or number > 0
    }
    if text in known:
        return known[text]
    choices = ", ".join(known)
    raise InvalidArgument(f"{what} must be one of {choices}, not '{text}'")


class Detail(Name):
    """How much of a frame is sent; each level holds all of the level before."""

    UNKNOWN = "unknown"
    CONTACTS = "contacts"  # status, times, contacts, total force
    GEOMETRY = "geometry"  # and the markers' positions
    FULL = "full"  # and displacements, covariances, nodal forces, sources


class LinkStatus(Name):
    UNKNOWN = "unknown"
    STARTING = "starting"  # no frame yet
    CALIBRATING = "calibrating"  # waits for a good rest picture; nothing is measured yet
    OK = "ok"
    DEGRADED = "degraded"  # measures, but worse than it could: see the reason
    LOST = "lost"  # the source or the markers are gone; nothing is measured now


class Reason(Name):
    """What makes a frame worse than it could be; docs/troubleshooting.md says what to do about each."""

    UNKNOWN = "unknown"
    FEW_MARKERS = "few_markers"  # too few are seen
    CAMERA = "camera"  # a camera gives no picture, or none that can be read
    FROZEN = "frozen"  # a camera gives the same picture again and again
    LATE = "late"  # a camera shows the skin's motion later than the other
    CAMERAS_DISAGREE = "cameras_disagree"  # the two pictures are not of one skin at one moment
    NOT_CONVERGED = "not_converged"  # no loads were found that explain the markers: no forces
    IMPOSSIBLE = "impossible"  # what was found is not physically possible: no forces
    NO_EQUILIBRIUM = "no_equilibrium"  # no skin of this model is stable under the pressure: no forces
    PRESSURE_UNKNOWN = "pressure_unknown"  # nobody tells it now
    PRESSURE_MISMATCH = "pressure_mismatch"  # what is told does not fit the skin's shape
    RESIDUAL = "residual"  # markers are off the estimated shape
    LABELS = "labels"  # labels were left out as contradicting the others
    TOO_DEEP = "too_deep"  # deeper than forces were compared with the truth
    BEYOND_MARKERS = "beyond_markers"  # a contact may lie where it hardly shows
    ENCIRCLED = "encircled"  # bodies all around bend the skin in waves
    SPARSE_MARKERS = "sparse_markers"  # no marker is in sight where a load may hide
    UNSETTLED = "unsettled"  # the shape did not settle where no camera sees it
    FORCE_MODEL = "force_model"  # the one that was asked for does not hold here
    CAMERAS_MOVED = "cameras_moved"  # further than is only taken off
    DRIFT = "drift"  # the baseline has drifted
    NO_FRAMES = "no_frames"  # none come from the cameras, files or log
    WORKER = "worker"  # what reads or computes the frames is late, has failed or is being started again
    FORCED_BASELINE = "forced_baseline"  # beside another one: a baseline taken by force may explain it


class ForceModel(Name):
    """How forces are computed from the shape."""

    UNKNOWN = "unknown"
    LINEAR = "linear"
    LITERAL = "literal"
    PRESSURISED = "pressurised"
    NONLINEAR = "nonlinear"
    AUTO = "auto"  # to set only: the cheapest that is good enough; frames tell which one that was


class MarkerSource(IntEnum):
    """How a marker's position was obtained; values of Frame.marker_sources."""

    UNKNOWN = 0
    BOTH = 1  # cameras
    TOP = 2
    BOTTOM = 3
    INFERRED = 4  # by the skin's mechanics


class TrackingMode(Name):
    NONE = "none"  # no labels
    ACQUIRED = "acquired"  # the full pictures were searched
    TRACKED = "tracked"  # only windows around where markers were expected


class AcquireReason(Name):
    """Why the full pictures were searched."""

    NONE = "none"  # they were not
    FIRST = "first"
    GAP = "gap"
    CAMERA = "camera"
    LOSS = "loss"
    RETRY = "retry"
    FORCED = "forced"


class PressureOrigin(Name):
    UNKNOWN = "unknown"
    NONE = "none"  # 0 for the baseline; what came since, the shape tells
    CONSTANT = "constant"
    SIMULATED = "simulated"
    FILE = "file"
    SERIAL = "serial"
    CLIENT = "client"


class BaselineOrigin(Name):
    """How the shape was taken against which displacements are measured."""

    NONE = "none"  # there is none yet
    START = "start"
    CALIBRATION = "calibration"
    TARE = "tare"
    FORCED_TARE = "forced_tare"  # what touched then is part of it


class DriftState(Name):
    """Whether the baseline follows a skin that creeps."""

    OFF = "off"
    FOLLOWING = "following"
    HELD = "held"


class Supervision(Name):
    """What the server's watchdog finds of a link's worker."""

    UNKNOWN = "unknown"
    RUNNING = "running"
    OVERDUE = "overdue"
    RESTARTING = "restarting"
    RESTING = "resting"  # until restart_link


class SourceKind(Name):
    UNKNOWN = "unknown"
    V4L2 = "v4l2"
    FILES = "files"
    SIMULATED = "simulated"
    LOG = "log"


class JointKind(Name):
    UNKNOWN = "unknown"
    REVOLUTE = "revolute"
    CONTINUOUS = "continuous"
    PRISMATIC = "prismatic"


class PoseValidity(Name):
    """How far a pose that depends on joints can be trusted; from STALE on it is doubtful."""

    UNSPECIFIED = "unspecified"
    FIXED = "fixed"  # no joint is involved
    INTERPOLATED = "interpolated"
    EXTRAPOLATED = "extrapolated"
    STALE = "stale"
    UNKNOWN = "unknown"  # a joint never had a state


class ForceLevel(Name):
    UNKNOWN = "unknown"
    NORMAL = "normal"
    WARNING = "warning"
    ALARM = "alarm"


class EventKind(Name):
    UNKNOWN = "unknown"
    CONTACT_BEGIN = "contact_begin"
    CONTACT_UPDATE = "contact_update"
    CONTACT_END = "contact_end"
    FORCE_LEVEL = "force_level"
    LINK_STATUS = "link_status"
    TARE = "tare"
    CALIBRATION = "calibration"
    BASELINE = "baseline"
    DRIFT = "drift"
    THRESHOLDS = "thresholds"
    FRAMES_LOST = "frames_lost"
    RECORDING = "recording"
    FORCE_MODEL = "force_model"
    CAMERA = "camera"


class Role(Name):
    """What a caller may do; each role may do all of the one before."""

    UNKNOWN = "unknown"
    NOBODY = "nobody"
    VIEWER = "viewer"
    OPERATOR = "operator"


class RecorderState(Name):
    UNKNOWN = "unknown"
    IDLE = "idle"
    RECORDING = "recording"
    TROUBLE = "trouble"  # it goes on trying; what comes meanwhile is lost and counted


class Compression(Name):
    """Of a log."""

    CONFIGURED = "configured"
    NONE = "none"
    ZSTD = "zstd"
    LZ4 = "lz4"


class LossReason(Name):
    UNKNOWN = "unknown"
    SLOW = "slow"  # the log's writer was too slow
    DISK = "disk"  # it did not take them
