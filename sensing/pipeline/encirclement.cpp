#include "sensing/pipeline/encirclement.h"

#include <algorithm>
#include <cmath>

#include "sensing/core/similar_skin.h"

namespace taclink {
namespace {

constexpr double kWidestStepDeg = 75, kBeltMm = 24;
// The sum of six discs on solids came out up to 21 % too large (tests/accuracy, squeeze).
constexpr double kSumShare = 0.12;
// Standard deviations of a uniform load all around in its limit of detection (LoadEstimator::Limits).
constexpr double kSigmasOfLimit = 13.6;

// The widest angle between two that follow each other around the axis.
double WidestStep(const std::vector<Contact>& contacts, const std::vector<size_t>& chosen) {
  constexpr double kFullTurn = 2 * kPi;
  std::vector<double> angles;
  for (const size_t i : chosen)
    angles.push_back(std::atan2(contacts[i].center_mm.y(), contacts[i].center_mm.x()));
  std::sort(angles.begin(), angles.end());
  double widest = angles.front() + kFullTurn - angles.back();
  for (size_t i = 1; i < angles.size(); ++i) widest = std::max(widest, angles[i] - angles[i - 1]);
  return widest;
}

}  // namespace

std::vector<Encirclement> FindEncirclements(const LinkModel& model, const std::vector<Contact>& contacts) {
  const double belt_mm = kBeltMm * LengthUnit(model);
  std::vector<Encirclement> found;
  std::vector<char> taken(contacts.size(), 0);
  for (size_t i = 0; i < contacts.size(); ++i) {
    if (taken[i] != 0) continue;
    Encirclement around;
    for (size_t j = 0; j < contacts.size(); ++j) {
      const bool beside = std::abs(contacts[j].center_mm.z() - contacts[i].center_mm.z()) <= belt_mm;
      if (taken[j] == 0 && (contacts[i].is_ring_contact ? j == i : beside && !contacts[j].is_ring_contact))
        around.contacts.push_back(j);
    }
    if (!contacts[i].is_ring_contact && WidestStep(contacts, around.contacts) >= RadFromDeg(kWidestStepDeg))
      continue;
    for (const size_t j : around.contacts) {
      taken[j] = 1;
      around.normal_force_n += contacts[j].normal_force_n;
    }
    found.push_back(std::move(around));
  }
  return found;
}

void AddEncirclementVariance(const LinkModel& model, double limit_around_n, std::vector<Contact>& contacts) {
  for (const Encirclement& around : FindEncirclements(model, contacts)) {
    const double variance_n2 =
        std::pow(kSumShare * around.normal_force_n, 2) + std::pow(limit_around_n / kSigmasOfLimit, 2);
    for (const size_t i : around.contacts) {
      Contact& contact = contacts[i];
      if (contact.is_ring_contact || !contact.force_covariance_n2 || around.normal_force_n <= 0) continue;
      *contact.force_covariance_n2 += contact.normal_force_n / around.normal_force_n * variance_n2 *
                                      contact.normal * contact.normal.transpose();
    }
  }
}

}  // namespace taclink
