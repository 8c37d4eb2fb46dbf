#include "bench/vision/skin_aging.h"

#include <cmath>

#include "sensing/core/similar_skin.h"

namespace taclink {
namespace {

// Of silicone rubber, per K, linear (datasheets have 2.5 to 3.2e-4); between clamps that do not give way
// what it can't grow along it grows around: 1 + nu.
constexpr double kGrowthPerK = 2.9e-4 * 1.5;

// beta sqrt(R t) of a shell that does not change its volume, (3 (1 - nu^2))^(1/4).
constexpr double kEdgeWave = 1.22;

// Of a long tube's radius that grows but is held at z = 0, by the distance from there in decay lengths: the
// edge disturbance of a cylinder (Timoshenko and Woinowsky-Krieger, Theory of Plates and Shells, art. 114).
double FreeOfClamp(double decays) {
  const double x = kEdgeWave * decays;
  return 1 - std::exp(-x) * (std::cos(x) + std::sin(x));
}

}  // namespace

AgingSkin::AgingSkin(const LinkModel& model, const SkinAging& aging, double duration_s)
    : model_(model),
      aging_(aging),
      duration_s_(duration_s),
      set_mm_(static_cast<size_t>(model.markers.count()), Vec3::Zero()) {}

void AgingSkin::Move(SkinTruth& truth) {
  if (!aging_.any()) return;
  if (truth.contacts.empty()) untouched_mm_ = truth.marker_mm;
  const double warmer_k = aging_.warmer_k * truth.time_s / duration_s_, decay_mm = DecayLengthMm(model_);
  for (size_t m = 0; m < truth.marker_mm.size(); ++m) {
    if (!untouched_mm_.empty()) {
      const Vec3 dent = truth.marker_mm[m] - untouched_mm_[m];
      if (aging_.set_share * dent.norm() > set_mm_[m].norm()) set_mm_[m] = aging_.set_share * dent;
    }
    const Vec3 rest = model_.RestMarker(static_cast<int>(m));
    const double grown_mm = kGrowthPerK * warmer_k * rest.head<2>().norm() *
                            FreeOfClamp(rest.z() / decay_mm) *
                            FreeOfClamp((model_.length_mm - rest.z()) / decay_mm);
    Vec3 by = set_mm_[m];
    by.head<2>() += grown_mm * rest.head<2>().normalized();
    truth.marker_mm[m] += by;
    truth.marker_wall_mm[m] += by;
  }
}

}  // namespace taclink
