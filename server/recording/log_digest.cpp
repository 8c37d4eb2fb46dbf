#include "server/recording/log_digest.h"

#include <algorithm>
#include <cmath>
#include <limits>

#include "wire/units.h"

namespace taclink::server {
namespace {

constexpr int64_t kSecondNs = 1'000'000'000;
constexpr size_t kMostParts = 60;
constexpr size_t kMostSeconds = size_t{7} * 24 * 3600;  // later frames count as the last
constexpr double kDisplacementSteps = 255;
constexpr float kNoPeak = std::numeric_limits<float>::quiet_NaN();

float Larger(float a, float b) {
  return std::isnan(a) || b > a ? b : a;
}

// In 255 steps: logs are listed by the thousand.
void FillDisplacements(const LinkModel& model, const std::vector<Vec3>& displacements_mm,
                       v1::StrongestContact& out) {
  const int count = model.markers.count();
  if (displacements_mm.size() < static_cast<size_t>(count)) return;
  double largest_mm = 0;
  for (int m = 0; m < count; ++m)
    largest_mm = std::max(largest_mm, displacements_mm[static_cast<size_t>(m)].norm());
  out.set_paths(static_cast<uint32_t>(model.markers.paths));
  out.set_rings(static_cast<uint32_t>(model.markers.rings()));
  out.set_largest_displacement_m(wire::kMetresPerMm * largest_mm);
  std::string& steps = *out.mutable_displacements();
  for (int ring = 0; ring < model.markers.rings(); ++ring) {
    for (int path = 0; path < model.markers.paths; ++path) {
      const auto marker = static_cast<size_t>(model.MarkerIndex(path, ring));
      const double share = largest_mm > 0 ? displacements_mm[marker].norm() / largest_mm : 0;
      steps += static_cast<char>(static_cast<uint8_t>(std::lround(kDisplacementSteps * share)));
    }
  }
}

}  // namespace

void LogDigest::Take(const std::string& link, const LinkModel& model, const LinkState& state,
                     int64_t log_utc_ns) {
  if (begin_utc_ns_ == 0) begin_utc_ns_ = log_utc_ns;
  const auto second = std::min(
      static_cast<size_t>(std::max<int64_t>(0, log_utc_ns - begin_utc_ns_) / kSecondNs), kMostSeconds - 1);
  if (peaks_n_.size() <= second) peaks_n_.resize(second + 1, kNoPeak);
  if (!state.has_forces()) return;
  peaks_n_[second] = Larger(peaks_n_[second], static_cast<float>(state.total_magnitude_n()));
  for (const Contact& contact : state.contacts) {
    if (!(contact.magnitude_n() > strongest_.magnitude_n())) continue;
    strongest_.Clear();
    strongest_.set_link(link);
    strongest_.set_log_utc_ns(log_utc_ns);
    strongest_.set_magnitude_n(contact.magnitude_n());
    strongest_.set_is_ring_contact(contact.is_ring_contact);
    if (!contact.is_ring_contact)
      strongest_.set_angle_rad(std::atan2(contact.center_mm.y(), contact.center_mm.x()));
    strongest_.set_z_m(wire::kMetresPerMm * contact.center_mm.z());
    FillDisplacements(model, state.shape.displacements_mm, strongest_);
  }
}

v1::LogSummary LogDigest::Summary() const {
  v1::LogSummary summary;
  const size_t parts = std::min(kMostParts, peaks_n_.size());
  for (size_t part = 0; part < parts; ++part) {
    float peak_n = kNoPeak;
    for (size_t i = part * peaks_n_.size() / parts; i < (part + 1) * peaks_n_.size() / parts; ++i)
      peak_n = Larger(peak_n, peaks_n_[i]);
    summary.add_peak_magnitude_n(peak_n);
  }
  if (strongest_.magnitude_n() > 0) *summary.mutable_strongest() = strongest_;
  return summary;
}

void LogDigest::Clear() {
  *this = {};
}

}  // namespace taclink::server
