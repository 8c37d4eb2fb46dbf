#include "sensing/pipeline/tare.h"

#include <algorithm>
#include <cstdio>
#include <string>

#include "sensing/core/similar_skin.h"

namespace taclink {
namespace {

constexpr double kTouchedN = 0.05;        // in ForceUnit
constexpr double kLeastSeenInTare = 0.5;  // in each picture
// Between the means of both halves, of the marker that moved most; in LengthUnit.
constexpr double kMovedMm = 0.15;

Error Refused(std::string why) {
  return {ErrorCode::kFailedPrecondition, std::move(why)};
}

std::string Number(const char* format, double value) {
  char text[32];
  std::snprintf(text, sizeof text, format, value);
  return text;
}

}  // namespace

TareCollector::TareCollector(const LinkModel& model, const TareOptions& options)
    : options_(options),
      touched_n_(kTouchedN * ForceUnit(model)),
      moved_mm_(kMovedMm * LengthUnit(model)),
      markers_(model.markers.count()),
      mean_(markers_),
      first_half_mm_(static_cast<size_t>(markers_), Vec3::Zero()),
      second_half_mm_(first_half_mm_) {}

std::optional<Error> TareCollector::Objection(const LinkState& state) const {
  for (const Contact& contact : state.contacts) {
    const double force_n = contact.magnitude_n();
    if (force_n < touched_n_) continue;
    return Refused("touched: a contact of " + Number("%.2f", force_n) +
                   " N at z = " + Number("%.0f", contact.center_mm.z()) +
                   " mm; let go of the skin, or force it if nothing touches");
  }
  for (const CameraId id : kBothCameras) {
    const int seen = state.cameras[Index(id)].labelled;
    if (seen >= kLeastSeenInTare * markers_) continue;
    return Refused("the " + std::string(Name(id)) + " camera sees only " + std::to_string(seen) + " of " +
                   std::to_string(markers_) + " markers; clear its view, or force it");
  }
  return {};
}

std::optional<Error> TareCollector::Motion() const {
  if (const std::string trouble = loads_.Trouble(); !trouble.empty())
    return Refused(trouble + ", or force it");
  const int half = frames() / 2;
  double most = 0;
  for (size_t m = 0; m < first_half_mm_.size() && half > 0; ++m)
    most = std::max(most, (second_half_mm_[m] / (frames() - half) - first_half_mm_[m] / half).norm());
  if (most <= moved_mm_ && !mean_.moved()) return {};
  return Refused("the skin moved by " + Number("%.2f", most) + " mm meanwhile; keep it still, or force it");
}

Result<bool> TareCollector::Add(const LinkState& state, const LabelledMarkers& labels,
                                std::span<const Vec3> off_mm, const MeasuredLoads& loads) {
  if (!state.measured() || off_mm.size() != first_half_mm_.size())
    return Refused("nothing is measured: " + state.status_reason);
  if (auto objection = Objection(state)) {
    if (!options_.force) return *std::move(objection);
    forced_ = true;
  }
  auto& half = frames() < options_.frames / 2 ? first_half_mm_ : second_half_mm_;
  for (size_t m = 0; m < half.size(); ++m) half[m] += off_mm[m];
  mean_.Add(labels);
  loads_.Add(loads);
  if (frames() < options_.frames) return false;
  mean_.Finish();
  if (auto motion = Motion()) {
    if (!options_.force) return *std::move(motion);
    forced_ = true;
  }
  return true;
}

double TareCollector::shift_mm() const {
  double most = 0;
  for (size_t m = 0; m < first_half_mm_.size(); ++m)
    most = std::max(most, (first_half_mm_[m] + second_half_mm_[m]).norm() / frames());
  return most;
}

}  // namespace taclink
