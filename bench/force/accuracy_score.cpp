#include "bench/force/accuracy_score.h"

#include <algorithm>
#include <cmath>
#include <limits>

namespace taclink {
namespace {

constexpr double kForceShare = 0.1, kForceN = 0.03, kNoPhantomN = 0.03;

bool Tolerated(double error_n, double true_n) {
  return error_n <= std::max(kForceShare * true_n, kForceN);
}

// Index of the nearest real contact and how far that is; -1: there is none.
std::pair<int, double> NearestTo(const std::vector<BodyContact>& contacts, const Vec3& point) {
  std::pair<int, double> nearest{-1, std::numeric_limits<double>::infinity()};
  for (size_t i = 0; i < contacts.size(); ++i) {
    if (contacts[i].force_n.isZero()) continue;
    const double distance = contacts[i].DistanceTo(point);
    if (distance < nearest.second) nearest = {static_cast<int>(i), distance};
  }
  return nearest;
}

struct Sum {
  Vec3 force = Vec3::Zero(), center = Vec3::Zero();
  Mat3 force_covariance = Mat3::Zero(), center_covariance = Mat3::Zero();  // the latter times weight^2
  double weight = 0;
};

double Deviations(double error, const Mat3& covariance) {
  const double variance = covariance.trace();
  return variance > 0 ? error / std::sqrt(variance) : 0;
}

ContactScore Compare(const BodyContact& real, const Sum& found) {
  ContactScore score;
  score.true_n = real.force_n.norm();
  score.missed = found.weight <= 0;
  score.size_error_n = std::abs(found.force.norm() - score.true_n);
  score.vector_error_n = (found.force - real.force_n).norm();
  score.direction_deg = 180;
  if (score.missed) return score;
  score.center_mm = (found.center / found.weight - real.center_mm).norm();
  score.force_deviations = Deviations(score.vector_error_n, found.force_covariance);
  score.center_deviations = Deviations(score.center_mm * found.weight, found.center_covariance);
  const double cosine = found.force.dot(real.force_n) / (found.force.norm() * score.true_n);
  if (std::isfinite(cosine)) score.direction_deg = DegFromRad(std::acos(std::clamp(cosine, -1.0, 1.0)));
  return score;
}

bool AllWithin(const FrameScore& frame, bool (ContactScore::*force)() const) {
  return frame.phantom_n <= kNoPhantomN &&
         std::all_of(frame.contacts.begin(), frame.contacts.end(),
                     [&](const ContactScore& c) { return (c.*force)() && c.CenterWithin(); });
}

}  // namespace

bool ContactScore::SizeWithin() const {
  return Tolerated(size_error_n, true_n);
}
bool ContactScore::VectorWithin() const {
  return Tolerated(vector_error_n, true_n);
}
bool FrameScore::Within() const {
  return AllWithin(*this, &ContactScore::SizeWithin);
}
bool FrameScore::VectorWithin() const {
  return AllWithin(*this, &ContactScore::VectorWithin);
}

FrameScore ScoreContacts(const LinkModel& model, const TrueStage& truth, const NodalForces& forces,
                         const std::vector<Contact>& found) {
  FrameScore frame;
  std::vector<Sum> sums(truth.contacts.size());
  for (const Contact& contact : found) {
    const auto [index, distance] = NearestTo(truth.contacts, contact.center_mm);
    const double size = contact.force_n.norm();
    if (distance > kPhantomMm) {
      frame.phantom_n += size;
      continue;
    }
    Sum& sum = sums[static_cast<size_t>(index)];
    sum.force += contact.force_n;
    sum.center += size * contact.center_mm;
    sum.weight += size;
    sum.force_covariance += contact.force_covariance_n2.value_or(Mat3::Zero());
    sum.center_covariance += size * size * contact.center_covariance_mm2.value_or(Mat3::Zero());
  }
  for (const int marker : forces.loaded) {
    const auto m = static_cast<size_t>(marker);
    const Vec3 at = model.RestMarker(marker) + truth.displacements_mm[m];
    if (NearestTo(truth.contacts, at).second > kPhantomMm) frame.stray_n += forces.forces_n[m].norm();
  }
  for (size_t i = 0; i < sums.size(); ++i) {
    if (truth.contacts[i].force_n.norm() >= kLeastForceN)
      frame.contacts.push_back(Compare(truth.contacts[i], sums[i]));
  }
  return frame;
}

}  // namespace taclink
