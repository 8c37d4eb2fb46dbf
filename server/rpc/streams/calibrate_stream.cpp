#include "server/rpc/streams/calibrate_stream.h"

#include <utility>

#include "server/rpc/requests/status.h"
#include "wire/units.h"

namespace taclink::server {
namespace {

void Fill(const CalibrationParameter& parameter, v1::CalibrationParameter& out) {
  const bool is_length = parameter.unit == "mm";
  const double unit = is_length ? wire::kMetresPerMm : 1;
  out.set_camera(Name(parameter.camera));
  out.set_name(parameter.name);
  out.set_unit(is_length ? "m" : parameter.unit);
  out.set_value(parameter.value * unit);
  out.set_fit_sigma(parameter.sigma * unit);
  if (parameter.mean) out.set_mean(*parameter.mean * unit);
  if (parameter.scatter) out.set_standard_deviation(*parameter.scatter * unit);
}

void Fill(const CalibrationProgress& progress, v1::CalibrateResponse& out) {
  if (!progress.end) {
    out.mutable_progress()->set_pairs_taken(static_cast<uint32_t>(progress.taken));
    out.mutable_progress()->set_pairs_wanted(static_cast<uint32_t>(progress.wanted));
    return;
  }
  const CalibrationResult& result = **progress.end;
  v1::CalibrationResult& message = *out.mutable_result();
  message.set_markers_used(static_cast<uint32_t>(result.markers_used));
  message.set_rms_px(result.rms_px);
  message.set_rmse_r_m(result.rmse_r_mm * wire::kMetresPerMm);
  message.set_rmse_tangential_m(result.rmse_tangential_mm * wire::kMetresPerMm);
  message.set_rmse_z_m(result.rmse_z_mm * wire::kMetresPerMm);
  message.set_file_text(result.file_text);
  message.set_saved_to(result.saved_to);
  for (const CalibrationParameter& one : result.parameters) Fill(one, *message.add_parameters());
  message.set_repeats(static_cast<uint32_t>(result.repeats));
  message.set_ended_early(result.ended_early);
  message.set_previous_utc_ns(result.previous_utc_ns);
  for (const CameraId id : kBothCameras) {
    const auto& move = result.moves[Index(id)];
    if (!move) continue;
    v1::CameraShift& shift = *message.add_shifts();
    shift.set_camera(Name(id));
    shift.set_moved_m(move->shift.moved_mm * wire::kMetresPerMm);
    shift.set_turned_rad(move->shift.turned_rad);
    shift.set_is_large(move->is_large);
  }
}

}  // namespace

std::shared_ptr<CalibrateStream> CalibrateStream::Make() {
  std::shared_ptr<CalibrateStream> stream(new CalibrateStream);
  stream->self_ = stream;
  return stream;
}

void CalibrateStream::End(const Error& error) {
  Tell({.end = error});
}

bool CalibrateStream::Tell(const CalibrationProgress& progress) {
  {
    const std::lock_guard lock(mutex_);
    if (cancelled_ || finished_) return false;
    if (waiting_ && waiting_->end) return false;  // the server ends the call: nothing may take that back
    waiting_ = progress;
  }
  Pump();
  return true;
}

void CalibrateStream::OnWriteDone(bool ok) {
  {
    const std::lock_guard lock(mutex_);
    writing_ = false;
    cancelled_ = cancelled_ || !ok;
  }
  Pump();
}

void CalibrateStream::OnCancel() {
  {
    const std::lock_guard lock(mutex_);
    cancelled_ = true;
  }
  Pump();
}

void CalibrateStream::OnDone() {
  const auto last = [this] {
    const std::lock_guard lock(mutex_);
    return std::exchange(self_, nullptr);
  }();
}

void CalibrateStream::Pump() {
  std::optional<CalibrationProgress> next;
  bool cancelled = false, succeeded = false;
  {
    const std::lock_guard lock(mutex_);
    if (writing_ || finished_) return;
    cancelled = cancelled_;
    succeeded = succeeded_;
    if (!cancelled && !succeeded && !waiting_) return;
    next = std::exchange(waiting_, std::nullopt);
    succeeded_ = next && next->end && next->end->ok();
    finished_ = cancelled || succeeded || (next->end && !next->end->ok());
    writing_ = !finished_;
  }
  // Outside the lock: writing_ or finished_ now keep every other thread from coming here.
  if (cancelled) return Finish(grpc::Status::CANCELLED);
  if (succeeded) return Finish(grpc::Status::OK);  // not with the message: see PumpedStream::Pump
  if (next->end && !*next->end) return Finish(ToGrpc(next->end->error()));
  message_.Clear();
  Fill(*next, message_);
  StartWrite(&message_);
}

}  // namespace taclink::server
