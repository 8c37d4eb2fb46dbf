#include "wire/convert.h"

#include <cmath>

#include "wire/units.h"

namespace taclink::wire {
namespace {

// Enough for a smooth outline and for R(z) to a few micrometres.
constexpr int kProfileSamples = 65;

}  // namespace

v1::Detail ToWire(Detail detail) {
  switch (detail) {
    case Detail::kContacts:
      return v1::DETAIL_CONTACTS;
    case Detail::kGeometry:
      return v1::DETAIL_GEOMETRY;
    case Detail::kFull:
      return v1::DETAIL_FULL;
  }
  return v1::DETAIL_UNSPECIFIED;
}

Detail FromWire(v1::Detail detail) {
  switch (detail) {
    case v1::DETAIL_GEOMETRY:
      return Detail::kGeometry;
    case v1::DETAIL_FULL:
      return Detail::kFull;
    default:
      return Detail::kContacts;
  }
}

v1::LinkStatus ToWire(LinkStatus status) {
  switch (status) {
    case LinkStatus::kStarting:
      return v1::LINK_STATUS_STARTING;
    case LinkStatus::kCalibrating:
      return v1::LINK_STATUS_CALIBRATING;
    case LinkStatus::kOk:
      return v1::LINK_STATUS_OK;
    case LinkStatus::kDegraded:
      return v1::LINK_STATUS_DEGRADED;
    case LinkStatus::kLost:
      return v1::LINK_STATUS_LOST;
  }
  return v1::LINK_STATUS_UNSPECIFIED;
}

static_assert(static_cast<int>(ReasonId::kFewMarkers) + 1 == v1::REASON_FEW_MARKERS &&
              static_cast<int>(ReasonId::kPressureMismatch) + 1 == v1::REASON_PRESSURE_MISMATCH &&
              static_cast<int>(ReasonId::kForcedBaseline) + 1 == v1::REASON_FORCED_BASELINE &&
              kReasonCount == v1::REASON_STIFFNESS_MISMATCH);
v1::Reason ToWire(ReasonId reason) {
  return static_cast<v1::Reason>(static_cast<int>(reason) + 1);
}

LinkStatus FromWire(v1::LinkStatus status) {
  switch (status) {
    case v1::LINK_STATUS_STARTING:
      return LinkStatus::kStarting;
    case v1::LINK_STATUS_CALIBRATING:
      return LinkStatus::kCalibrating;
    case v1::LINK_STATUS_OK:
      return LinkStatus::kOk;
    case v1::LINK_STATUS_DEGRADED:
      return LinkStatus::kDegraded;
    default:
      return LinkStatus::kLost;
  }
}

v1::ForceModel ToWire(ForceModel model) {
  switch (model) {
    case ForceModel::kLiteral:
      return v1::FORCE_MODEL_LITERAL;
    case ForceModel::kLinear:
      return v1::FORCE_MODEL_LINEAR;
    case ForceModel::kPressurised:
      return v1::FORCE_MODEL_PRESSURISED;
    case ForceModel::kNonlinear:
      return v1::FORCE_MODEL_NONLINEAR;
  }
  return v1::FORCE_MODEL_UNSPECIFIED;
}

ForceModel FromWire(v1::ForceModel model) {
  switch (model) {
    case v1::FORCE_MODEL_LITERAL:
      return ForceModel::kLiteral;
    case v1::FORCE_MODEL_PRESSURISED:
      return ForceModel::kPressurised;
    case v1::FORCE_MODEL_NONLINEAR:
      return ForceModel::kNonlinear;
    default:
      return ForceModel::kLinear;
  }
}

v1::MarkerSource ToWire(MarkerSource source) {
  switch (source) {
    case MarkerSource::kBoth:
      return v1::MARKER_SOURCE_BOTH;
    case MarkerSource::kTop:
      return v1::MARKER_SOURCE_TOP;
    case MarkerSource::kBottom:
      return v1::MARKER_SOURCE_BOTTOM;
    case MarkerSource::kInferred:
      return v1::MARKER_SOURCE_INFERRED;
  }
  return v1::MARKER_SOURCE_UNSPECIFIED;
}

MarkerSource FromWire(v1::MarkerSource source) {
  switch (source) {
    case v1::MARKER_SOURCE_BOTH:
      return MarkerSource::kBoth;
    case v1::MARKER_SOURCE_TOP:
      return MarkerSource::kTop;
    case v1::MARKER_SOURCE_BOTTOM:
      return MarkerSource::kBottom;
    default:
      return MarkerSource::kInferred;
  }
}

void Fill(const FrameTimes& times, v1::FrameTimes& out) {
  out.set_exposure_utc_ns(times.exposure_utc_ns);
  out.set_exposure_ns(times.exposure_monotonic_ns);
  out.set_received_ns(times.received_ns);
  out.set_tracked_ns(times.tracked_ns);
  out.set_solved_ns(times.solved_ns);
  out.set_published_ns(times.published_ns);
}

void FillCovariance(const Mat3& covariance, double scale, google::protobuf::RepeatedField<double>& out) {
  for (const auto& [row, column] : kUpperTriangle) out.Add(covariance(row, column) * scale * scale);
}

void Fill(const Vec3& value, double scale, v1::Vector3& out) {
  out.set_x(value.x() * scale);
  out.set_y(value.y() * scale);
  out.set_z(value.z() * scale);
}

Vec3 FromWire(const v1::Vector3& value, double scale) {
  return {value.x() * scale, value.y() * scale, value.z() * scale};
}

void Fill(const Rigid3& base_from_link, v1::Pose& out) {
  Fill(base_from_link.translation, kMetresPerMm, *out.mutable_translation_m());
  const Eigen::Quaterniond q(base_from_link.rotation);
  auto& rotation = *out.mutable_rotation();
  rotation.set_x(q.x());
  rotation.set_y(q.y());
  rotation.set_z(q.z());
  rotation.set_w(q.w());
}

void Fill(const LinkModel& model, v1::LinkModel& out) {
  out.set_name(model.name);
  out.set_description(model.description);
  out.set_length_m(model.length_mm * kMetresPerMm);
  out.set_thickness_m(model.thickness_mm * kMetresPerMm);
  out.set_tube_radius_m(model.tube_outer_radius_mm * kMetresPerMm);
  out.mutable_material()->set_youngs_modulus_pa(model.material.youngs_modulus_mpa * kPascalsPerMpa);
  out.mutable_material()->set_poisson_ratio(model.material.poisson_ratio);
  for (const RelaxationTerm& term : model.relaxation.terms) {
    v1::RelaxationTerm& relaxation = *out.mutable_material()->add_relaxation();
    relaxation.set_share(term.share);
    relaxation.set_time_s(term.time_s);
  }

  auto& markers = *out.mutable_markers();
  markers.set_paths(static_cast<uint32_t>(model.markers.paths));
  markers.set_rings(static_cast<uint32_t>(model.markers.rings()));
  markers.set_first_path_angle_rad(model.markers.first_path_angle_rad);
  for (const double z : model.markers.rings_z_mm) markers.add_ring_z_m(z * kMetresPerMm);
  markers.set_diameter_m(model.markers.diameter_mm * kMetresPerMm);
  for (const Vec3& p : model.RestMarkers()) {
    for (int axis = 0; axis < 3; ++axis)
      markers.add_rest_positions_m(static_cast<float>(p[axis] * kMetresPerMm));
  }

  // The normal of a slanted surface leans along z, so the outer point's own z and radius are sent; the ends
  // are where the skin is clamped.
  for (int i = 0; i < kProfileSamples; ++i) {
    const double z = model.length_mm * i / (kProfileSamples - 1);
    const Vec3 outer = model.PointAtDepth(0, z, 0);
    const bool end = i == 0 || i == kProfileSamples - 1;
    out.add_profile_z_m((end ? z : outer.z()) * kMetresPerMm);
    out.add_profile_radius_m(outer.x() * kMetresPerMm);
  }
}

// Both are numbered alike.
static_assert(static_cast<int>(TrackingMode::kTracked) == v1::TRACKING_MODE_TRACKED);
static_assert(static_cast<int>(AcquireReason::kForced) == v1::ACQUIRE_REASON_FORCED);

static_assert(static_cast<int>(PressureOrigin::kNone) + 1 == v1::PRESSURE_ORIGIN_NONE);
static_assert(static_cast<int>(PressureOrigin::kSimulated) + 1 == v1::PRESSURE_ORIGIN_SIMULATED);
static_assert(static_cast<int>(PressureOrigin::kClient) + 1 == v1::PRESSURE_ORIGIN_CLIENT);
static_assert(static_cast<int>(PressureOrigin::kRegulator) + 1 == v1::PRESSURE_ORIGIN_REGULATOR);

void Fill(const PressureReport& report, v1::PressureReport& out) {
  out.set_origin(static_cast<v1::PressureOrigin>(static_cast<int>(report.origin) + 1));
  out.set_assumed(report.assumed());
  out.set_stale(report.stale);
  out.set_pressure_pa(report.mpa * kPascalsPerMpa);
  if (report.age_ns >= 0) out.set_age_s(static_cast<double>(report.age_ns) * 1e-9);
  out.set_trouble(report.trouble);
}

PressureReport FromWire(const v1::PressureReport& message) {
  PressureReport report;
  if (v1::PressureOrigin_IsValid(message.origin()) && message.origin() != v1::PRESSURE_ORIGIN_UNSPECIFIED)
    report.origin = static_cast<PressureOrigin>(message.origin() - 1);
  report.stale = message.stale();
  report.mpa = message.pressure_pa() / kPascalsPerMpa;
  if (message.has_age_s()) report.age_ns = std::llround(message.age_s() * 1e9);
  report.trouble = message.trouble();
  return report;
}

v1::TrackingMode ToWire(TrackingMode mode) {
  return static_cast<v1::TrackingMode>(mode);
}

TrackingMode FromWire(v1::TrackingMode mode) {
  return v1::TrackingMode_IsValid(mode) ? static_cast<TrackingMode>(mode) : TrackingMode::kNone;
}

v1::AcquireReason ToWire(AcquireReason reason) {
  return static_cast<v1::AcquireReason>(reason);
}

AcquireReason FromWire(v1::AcquireReason reason) {
  return v1::AcquireReason_IsValid(reason) ? static_cast<AcquireReason>(reason) : AcquireReason::kNone;
}

}  // namespace taclink::wire
