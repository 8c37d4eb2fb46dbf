#include "wire/frame_codec.h"

#include <google/protobuf/io/coded_stream.h>

#include <algorithm>
#include <array>

#include "taclink/v1/tactile.pb.h"
#include "wire/convert.h"
#include "wire/units.h"

namespace taclink::wire {
namespace {

using Floats = google::protobuf::RepeatedField<float>;

void FillVectors(const std::vector<Vec3>& values, double scale, Floats& out) {
  out.Reserve(static_cast<int>(values.size()) * 3);
  for (const Vec3& value : values) {
    for (int axis = 0; axis < 3; ++axis) out.AddAlreadyReserved(static_cast<float>(value[axis] * scale));
  }
}

std::vector<Vec3> VectorsFrom(const Floats& values, double scale) {
  std::vector<Vec3> out(static_cast<size_t>(values.size()) / 3);
  for (size_t i = 0; i < out.size(); ++i) {
    for (int axis = 0; axis < 3; ++axis) {
      out[i][axis] = static_cast<double>(values[static_cast<int>(i) * 3 + axis]) * scale;
    }
  }
  return out;
}

FrameTimes TimesFrom(const v1::FrameTimes& times) {
  return {.exposure_monotonic_ns = times.exposure_ns(),
          .exposure_utc_ns = times.exposure_utc_ns(),
          .received_ns = times.received_ns(),
          .tracked_ns = times.tracked_ns(),
          .solved_ns = times.solved_ns(),
          .published_ns = times.published_ns()};
}

void FillStageTimes(const StageTimes& ms, v1::StageTimes& out) {
  out.set_decode_s(ms.decode * kSecondsPerMs);
  out.set_detect_s(ms.detect * kSecondsPerMs);
  out.set_register_s(ms.register_ * kSecondsPerMs);
  out.set_reconstruct_s(ms.reconstruct * kSecondsPerMs);
  out.set_force_s(ms.force * kSecondsPerMs);
}

StageTimes StageTimesFrom(const v1::StageTimes& s) {
  return {.decode = s.decode_s() / kSecondsPerMs,
          .detect = s.detect_s() / kSecondsPerMs,
          .register_ = s.register_s() / kSecondsPerMs,
          .reconstruct = s.reconstruct_s() / kSecondsPerMs,
          .force = s.force_s() / kSecondsPerMs};
}

std::optional<Mat3> CovarianceFrom(const google::protobuf::RepeatedField<double>& numbers, double scale) {
  if (numbers.size() != static_cast<int>(kUpperTriangle.size())) return std::nullopt;
  Mat3 covariance;
  int next = 0;
  for (const auto& [row, column] : kUpperTriangle) {
    covariance(row, column) = covariance(column, row) = numbers[next++] * scale * scale;
  }
  return covariance;
}

void FillContact(const Contact& contact, Detail detail, v1::Contact& out) {
  out.set_id(contact.id);
  out.set_is_ring_contact(contact.is_ring_contact);
  Fill(contact.center_mm, kMetresPerMm, *out.mutable_center_m());
  Fill(contact.normal, 1, *out.mutable_normal());
  Fill(contact.force_n, 1, *out.mutable_force_n());
  if (contact.force_covariance_n2) {
    FillCovariance(*contact.force_covariance_n2, 1, *out.mutable_force_covariance_n2());
  }
  if (contact.center_covariance_mm2) {
    FillCovariance(*contact.center_covariance_mm2, kMetresPerMm, *out.mutable_center_covariance_m2());
  }
  out.set_normal_force_n(contact.normal_force_n);
  out.set_area_m2(contact.area_mm2 * kSquareMetresPerMm2);
  for (const int marker : contact.markers) out.add_markers(static_cast<uint32_t>(marker));
  Fill(contact.moment_nmm, kMetresPerMm, *out.mutable_moment_nm());
  out.set_peak_pressure_pa(contact.peak_pressure_mpa * kPascalsPerMpa);
  Fill(contact.major_axis_mm, kMetresPerMm, *out.mutable_major_axis_m());
  Fill(contact.minor_axis_mm, kMetresPerMm, *out.mutable_minor_axis_m());
  if (detail != Detail::kContacts) FillVectors(contact.outline_mm, kMetresPerMm, *out.mutable_outline_m());
}

Contact ContactFrom(const v1::Contact& message) {
  Contact contact;
  contact.id = message.id();
  contact.is_ring_contact = message.is_ring_contact();
  contact.center_mm = FromWire(message.center_m(), 1 / kMetresPerMm);
  contact.normal = FromWire(message.normal(), 1);
  contact.force_n = FromWire(message.force_n(), 1);
  contact.force_covariance_n2 = CovarianceFrom(message.force_covariance_n2(), 1);
  contact.center_covariance_mm2 = CovarianceFrom(message.center_covariance_m2(), 1 / kMetresPerMm);
  contact.normal_force_n = message.normal_force_n();
  contact.area_mm2 = message.area_m2() / kSquareMetresPerMm2;
  for (const uint32_t marker : message.markers()) contact.markers.push_back(static_cast<int>(marker));
  contact.moment_nmm = FromWire(message.moment_nm(), 1 / kMetresPerMm);
  contact.peak_pressure_mpa = message.peak_pressure_pa() / kPascalsPerMpa;
  contact.major_axis_mm = FromWire(message.major_axis_m(), 1 / kMetresPerMm);
  contact.minor_axis_mm = FromWire(message.minor_axis_m(), 1 / kMetresPerMm);
  contact.outline_mm = VectorsFrom(message.outline_m(), 1 / kMetresPerMm);
  return contact;
}

void FillFull(const LinkState& state, v1::LinkFrame& out) {
  FillVectors(state.shape.displacements_mm, kMetresPerMm, *out.mutable_displacements_m());
  auto& covariances = *out.mutable_displacement_covariances_m2();
  covariances.Reserve(static_cast<int>(state.shape.covariances_mm2.size() * kUpperTriangle.size()));
  for (const Mat3& covariance : state.shape.covariances_mm2) {
    for (const auto& [row, column] : kUpperTriangle) {
      covariances.AddAlreadyReserved(static_cast<float>(covariance(row, column) * kSquareMetresPerMm2));
    }
  }
  for (const MarkerSource source : state.shape.sources) out.add_marker_sources(ToWire(source));
  if (state.has_forces()) {
    FillVectors(state.forces.forces_n, 1, *out.mutable_nodal_forces_n());
    for (const double sigma : state.forces.sigmas_n) out.add_nodal_force_sigmas_n(static_cast<float>(sigma));
    for (const double limit : state.forces.limits_n) out.add_detection_limits_n(static_cast<float>(limit));
  }
  out.set_force_not_converged(!state.forces.converged);
}

void ReadFull(const v1::LinkFrame& frame, LinkState& state) {
  state.shape.displacements_mm = VectorsFrom(frame.displacements_m(), 1 / kMetresPerMm);
  const auto& covariances = frame.displacement_covariances_m2();
  state.shape.covariances_mm2.resize(static_cast<size_t>(covariances.size()) / kUpperTriangle.size());
  int next = 0;
  for (Mat3& covariance : state.shape.covariances_mm2) {
    for (const auto& [row, column] : kUpperTriangle) {
      const double value = static_cast<double>(covariances[next++]) / kSquareMetresPerMm2;
      covariance(row, column) = value;
      covariance(column, row) = value;
    }
  }
  for (const int source : frame.marker_sources()) {
    state.shape.sources.push_back(FromWire(static_cast<v1::MarkerSource>(source)));
  }
  state.forces.forces_n = VectorsFrom(frame.nodal_forces_n(), 1);
  state.forces.sigmas_n.assign(frame.nodal_force_sigmas_n().begin(), frame.nodal_force_sigmas_n().end());
  state.forces.limits_n.assign(frame.detection_limits_n().begin(), frame.detection_limits_n().end());
  state.forces.converged = !frame.force_not_converged();
}

// Whether an array of `size` numbers holds `each` for every marker, or nothing at all.
bool Fits(int size, int each, int markers) {
  return size == 0 || size == each * markers;
}

bool LengthsFit(const v1::LinkFrame& frame) {
  const int markers = frame.positions_m_size() / 3;
  return frame.positions_m_size() % 3 == 0 && Fits(frame.displacements_m_size(), 3, markers) &&
         Fits(frame.displacement_covariances_m2_size(), 6, markers) &&
         Fits(frame.nodal_forces_n_size(), 3, markers) &&
         Fits(frame.nodal_force_sigmas_n_size(), 1, markers) &&
         Fits(frame.marker_sources_size(), 1, markers) && Fits(frame.detection_limits_n_size(), 1, markers);
}

double SiPer(ReasonUnit unit) {
  switch (unit) {
    case ReasonUnit::kMillimeters:
      return kMetresPerMm;
    case ReasonUnit::kMegapascals:
      return kPascalsPerMpa;
    default:
      return 1;
  }
}

const char* SiName(ReasonUnit unit) {
  switch (unit) {
    case ReasonUnit::kMillimeters:
      return "m";
    case ReasonUnit::kMegapascals:
      return "Pa";
    case ReasonUnit::kSeconds:
      return "s";
    case ReasonUnit::kHertz:
      return "Hz";
    case ReasonUnit::kNone:
      break;
  }
  return "";
}

void FillReason(const Reason& reason, v1::StatusReason& out) {
  out.set_id(Name(reason.id));
  out.set_text(reason.text);
  out.set_reason(ToWire(reason.id));
  const ReasonUnit unit = TraitsOf(reason.id).unit;
  if (reason.value) out.set_value(*reason.value * SiPer(unit));
  if (reason.limit) out.set_limit(*reason.limit * SiPer(unit));
  out.set_unit(SiName(unit));
}

// By its name, which all versions have. None: another version's.
std::optional<Reason> ReasonFrom(const v1::StatusReason& message) {
  const auto id = ReasonNamed(message.id());
  if (!id) return std::nullopt;
  Reason reason{*id, message.text()};
  const double per = SiPer(TraitsOf(*id).unit);
  if (message.has_value()) reason.value = message.value() / per;
  if (message.has_limit()) reason.limit = message.limit() / per;
  return reason;
}

void FillCamera(const CameraCounts& counts, const CameraTracking& tracking, v1::CameraCounts& out) {
  out.set_detections(static_cast<uint32_t>(counts.detections));
  out.set_labelled(static_cast<uint32_t>(counts.labelled));
  out.set_share_read(static_cast<float>(tracking.share_read));
  out.set_verified(static_cast<uint32_t>(tracking.verified));
  out.set_measured(static_cast<uint32_t>(tracking.measured));
  out.set_searched(static_cast<uint32_t>(tracking.searched));
  out.set_found(static_cast<uint32_t>(tracking.found));
  out.set_dropped(static_cast<uint32_t>(tracking.dropped));
  out.clear_contrast();
  if (counts.contrast) out.set_contrast(static_cast<float>(*counts.contrast));
}

void ReadCamera(const v1::CameraCounts& camera, CameraCounts& counts, CameraTracking& tracking) {
  counts = {.detections = static_cast<int>(camera.detections()),
            .labelled = static_cast<int>(camera.labelled()),
            .contrast = std::nullopt};
  if (camera.has_contrast()) counts.contrast = static_cast<double>(camera.contrast());
  tracking = {.share_read = camera.share_read(),
              .verified = static_cast<int>(camera.verified()),
              .measured = static_cast<int>(camera.measured()),
              .searched = static_cast<int>(camera.searched()),
              .found = static_cast<int>(camera.found()),
              .dropped = static_cast<int>(camera.dropped())};
}

// Both are numbered alike.
static_assert(static_cast<int>(AttitudeOrigin::kNone) + 1 == v1::ATTITUDE_ORIGIN_NONE &&
              static_cast<int>(AttitudeOrigin::kJointStates) + 1 == v1::ATTITUDE_ORIGIN_JOINT_STATES &&
              static_cast<int>(AttitudeOrigin::kClient) + 1 == v1::ATTITUDE_ORIGIN_CLIENT);

void FillSpecificForce(const SpecificForceReading& reading, v1::SpecificForceReport& out) {
  Fill(reading.mps2, 1, *out.mutable_specific_force_mps2());
  if (!reading.covariance.isZero(0)) FillCovariance(reading.covariance, 1, *out.mutable_covariance_m2_s4());
  out.set_origin(static_cast<v1::AttitudeOrigin>(static_cast<int>(reading.origin) + 1));
  out.set_trouble(reading.trouble);
}

SpecificForceReading SpecificForceFrom(const v1::SpecificForceReport& message) {
  SpecificForceReading reading{
      .mps2 = FromWire(message.specific_force_mps2(), 1),
      .covariance = CovarianceFrom(message.covariance_m2_s4(), 1).value_or(Mat3::Zero()),
      .origin = AttitudeOrigin::kNone,
      .trouble = message.trouble()};
  if (v1::AttitudeOrigin_IsValid(message.origin()) && message.origin() != v1::ATTITUDE_ORIGIN_UNSPECIFIED)
    reading.origin = static_cast<AttitudeOrigin>(message.origin() - 1);
  return reading;
}

void FillSimulation(const SimulationReport& simulation, v1::SimulationReport& out) {
  out.set_trouble(simulation.trouble);
  for (const AppliedContact& contact : simulation.contacts) {
    v1::AppliedContact& message = *out.add_contacts();
    message.set_body_id(contact.body_id);
    Fill(contact.center_mm, kMetresPerMm, *message.mutable_center_m());
    Fill(contact.normal, 1, *message.mutable_normal());
    Fill(contact.force_n, 1, *message.mutable_force_n());
    message.set_depth_m(contact.depth_mm * kMetresPerMm);
  }
}

SimulationReport SimulationFrom(const v1::SimulationReport& message) {
  SimulationReport simulation{.contacts = {}, .trouble = message.trouble()};
  for (const v1::AppliedContact& contact : message.contacts())
    simulation.contacts.push_back({.body_id = contact.body_id(),
                                   .center_mm = FromWire(contact.center_m(), 1 / kMetresPerMm),
                                   .normal = FromWire(contact.normal(), 1),
                                   .force_n = FromWire(contact.force_n(), 1),
                                   .depth_mm = contact.depth_m() / kMetresPerMm});
  return simulation;
}

}  // namespace

void Fill(const LinkId& link, const LinkState& state, Detail detail, v1::LinkFrame& out) {
  out.Clear();
  out.set_link(link.name);
  out.set_link_index(link.index);
  out.set_sequence(state.sequence);
  Fill(state.times, *out.mutable_times());
  out.set_status(ToWire(state.status));
  out.set_status_reason(state.status_reason);
  out.set_detail(ToWire(detail));
  if (state.pressure_mpa) out.set_pressure_pa(*state.pressure_mpa * kPascalsPerMpa);
  if (state.times.exposure_monotonic_ns != 0) Fill(state.pressure, *out.mutable_pressure());
  out.set_markers_seen(static_cast<uint32_t>(state.shape.seen()));
  out.set_markers_inferred(static_cast<uint32_t>(state.shape.CountOf(MarkerSource::kInferred)));
  for (const Contact& contact : state.contacts) FillContact(contact, detail, *out.add_contacts());
  if (state.has_forces()) {
    Fill(state.total_force_n, 1, *out.mutable_total_force_n());
    out.set_force_residual(state.forces.residual);
    out.set_camera_shift_m(state.forces.camera_shift_mm * kMetresPerMm);
    if (!state.forces.limits_n.empty()) {
      out.set_detection_limit_n(
          *std::max_element(state.forces.limits_n.begin(), state.forces.limits_n.end()));
      out.set_detection_limit_around_n(state.forces.limit_around_n);
    }
  }
  for (const Reason& reason : state.reasons) FillReason(reason, *out.add_status_reasons());
  if (state.pressure_estimate) {
    out.mutable_pressure_estimate()->set_pressure_pa(state.pressure_estimate->mpa * kPascalsPerMpa);
    out.mutable_pressure_estimate()->set_sigma_pa(state.pressure_estimate->sigma_mpa * kPascalsPerMpa);
  }
  if (state.specific_force) FillSpecificForce(*state.specific_force, *out.mutable_specific_force());
  if (const auto& estimate = state.specific_force_estimate) {
    Fill(estimate->mps2, 1, *out.mutable_specific_force_estimate()->mutable_specific_force_mps2());
    FillCovariance(estimate->covariance, 1,
                   *out.mutable_specific_force_estimate()->mutable_covariance_m2_s4());
  }
  if (state.simulation) FillSimulation(*state.simulation, *out.mutable_simulation());
  out.set_force_model(ToWire(state.forces.model));
  out.set_baseline_age_s(state.baseline_age_s);
  Fill(state.baseline, *out.mutable_baseline());
  FillStageTimes(state.stage_ms, *out.mutable_stage_times());
  for (size_t i = 0; i < kCameraCount; ++i)
    FillCamera(state.cameras[i], state.tracking.cameras[i], *out.add_cameras());
  out.set_tracking_mode(ToWire(state.tracking.mode));
  out.set_acquire_reason(ToWire(state.tracking.reason));
  out.set_labels_rejected(static_cast<uint32_t>(state.shape.rejected.size()));
  out.set_replayed(state.replayed);
  if (detail >= Detail::kGeometry)
    FillVectors(state.shape.positions_mm, kMetresPerMm, *out.mutable_positions_m());
  if (detail >= Detail::kFull) FillFull(state, out);
}

std::string EncodeFrame(const LinkId& link, const LinkState& state, Detail detail) {
  thread_local v1::LinkFrame frame;  // keeps its arrays from frame to frame
  Fill(link, state, detail, frame);
  return frame.SerializeAsString();
}

std::string FrameResponsePrefix(size_t frame_bytes) {
  using google::protobuf::io::CodedOutputStream;
  constexpr uint32_t kLengthDelimited = 2;
  constexpr uint32_t kTag = v1::StreamFramesResponse::kFrameFieldNumber << 3 | kLengthDelimited;
  std::array<uint8_t, 10> buffer{};
  uint8_t* end = CodedOutputStream::WriteVarint32ToArray(kTag, buffer.data());
  end = CodedOutputStream::WriteVarint32ToArray(static_cast<uint32_t>(frame_bytes), end);
  return {buffer.data(), end};
}

std::string UnchangedMark() {
  v1::LinkFrame frame;
  frame.set_unchanged(true);
  return frame.SerializeAsString();
}

std::string ReplayedMark() {
  v1::LinkFrame frame;
  frame.set_replayed(true);
  return frame.SerializeAsString();
}

Result<DecodedFrame> FromWire(const v1::LinkFrame& frame) {
  if (!LengthsFit(frame)) {
    return Error{ErrorCode::kInvalidArgument, "frame " + std::to_string(frame.sequence()) + " of link '" +
                                                  frame.link() +
                                                  "' has arrays of lengths that do not fit each other"};
  }
  DecodedFrame decoded{
      .link = {frame.link(), frame.link_index()}, .detail = FromWire(frame.detail()), .state = {}};
  LinkState& state = decoded.state;
  state.sequence = frame.sequence();
  state.times = TimesFrom(frame.times());
  state.status = FromWire(frame.status());
  state.status_reason = frame.status_reason();
  if (frame.has_pressure()) state.pressure = FromWire(frame.pressure());
  if (frame.has_pressure_pa()) state.pressure_mpa = frame.pressure_pa() / kPascalsPerMpa;
  for (const auto& contact : frame.contacts()) state.contacts.push_back(ContactFrom(contact));
  for (const v1::StatusReason& reason : frame.status_reasons()) {
    if (auto known = ReasonFrom(reason)) state.reasons.push_back(*std::move(known));
  }
  if (frame.has_pressure_estimate())
    state.pressure_estimate = {frame.pressure_estimate().pressure_pa() / kPascalsPerMpa,
                               frame.pressure_estimate().sigma_pa() / kPascalsPerMpa};
  if (frame.has_specific_force()) state.specific_force = SpecificForceFrom(frame.specific_force());
  if (frame.has_specific_force_estimate()) {
    const v1::SpecificForceEstimate& estimate = frame.specific_force_estimate();
    state.specific_force_estimate = {FromWire(estimate.specific_force_mps2(), 1),
                                     CovarianceFrom(estimate.covariance_m2_s4(), 1).value_or(Mat3::Zero())};
  }
  if (frame.has_simulation()) state.simulation = SimulationFrom(frame.simulation());
  state.total_force_n = FromWire(frame.total_force_n(), 1);
  state.forces.model = FromWire(frame.force_model());
  state.forces.residual = frame.force_residual();
  state.forces.camera_shift_mm = frame.camera_shift_m() / kMetresPerMm;
  state.forces.limit_around_n = frame.detection_limit_around_n();
  state.baseline_age_s = frame.baseline_age_s();
  state.baseline = FromWire(frame.baseline());
  state.stage_ms = StageTimesFrom(frame.stage_times());
  for (size_t i = 0; i < kCameraCount && static_cast<int>(i) < frame.cameras_size(); ++i) {
    ReadCamera(frame.cameras(static_cast<int>(i)), state.cameras[i], state.tracking.cameras[i]);
  }
  state.tracking.mode = FromWire(frame.tracking_mode());
  state.tracking.reason = FromWire(frame.acquire_reason());
  state.replayed = frame.replayed();
  state.shape.positions_mm = VectorsFrom(frame.positions_m(), 1 / kMetresPerMm);
  ReadFull(frame, state);
  const bool is_measured = state.status == LinkStatus::kOk || state.status == LinkStatus::kDegraded;
  if (is_measured && !frame.has_total_force_n()) state.forces.converged = false;
  return decoded;
}

Result<DecodedFrame> DecodeFrame(std::string_view bytes) {
  v1::LinkFrame frame;
  if (!frame.ParseFromArray(bytes.data(), static_cast<int>(bytes.size()))) {
    return Error{ErrorCode::kInvalidArgument, "these bytes are no LinkFrame message"};
  }
  return FromWire(frame);
}

}  // namespace taclink::wire
