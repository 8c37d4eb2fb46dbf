#include "tests/accuracy/solid_judge.h"

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <utility>

namespace taclink {
namespace {

constexpr double kShare = 0.1, kLeastN = 0.03, kCenterMm = 4, kNearMm = 25;

std::string Text(const char* format, double a, double b) {
  char text[160];
  std::snprintf(text, sizeof text, format, a, b);
  return text;
}

void SetFault(SolidVerdict& verdict, std::string fault) {
  if (verdict.fault.empty()) verdict.fault = std::move(fault);
}

void JudgeSum(const SolidScene& scene, const std::vector<Contact>& found, SolidVerdict& verdict) {
  Vec3 truth = Vec3::Zero(), sum = Vec3::Zero();
  double total = 0, normal = 0;
  for (const SolidContact& c : scene.contacts) {
    truth += c.force_n;
    total += c.normal_force_n;
  }
  for (const Contact& f : found) {
    sum += f.force_n;
    normal += f.normal_force_n;
  }
  const double allowed = std::max(kShare * total, kLeastN);
  const double vector_error = (sum - truth).norm();
  verdict.force_error_n = std::max({verdict.force_error_n, std::abs(normal - total), vector_error});
  if (std::abs(normal - total) > allowed)
    SetFault(verdict, Text("total %.3f instead of %.3f N", normal, total));
  if (vector_error > allowed) SetFault(verdict, Text("vector off by %.3f of %.3f N", vector_error, total));
}

struct Matched {
  Vec3 force = Vec3::Zero(), center = Vec3::Zero();
  double weight = 0;
};

// Which true contact a found one is of, and how far from its edge.
std::pair<size_t, double> Nearest(const SolidScene& scene, const Contact& found) {
  size_t nearest = 0;
  double best = 1e9;
  for (size_t i = 0; i < scene.contacts.size(); ++i) {
    const SolidContact& c = scene.contacts[i];
    const double off = (found.center_mm - c.center_mm).norm() - c.extent_mm.norm();
    if (off < best) {
      best = off;
      nearest = i;
    }
  }
  return {nearest, best};
}

}  // namespace

SolidVerdict JudgeContacts(const SolidScene& scene, const std::vector<Contact>& found) {
  const bool wide = scene.IsDistributed();
  SolidVerdict verdict;
  std::vector<Matched> matched(scene.contacts.size());
  for (const Contact& f : found) {
    const auto [nearest, off] = Nearest(scene, f);
    const double strongest = std::max(f.force_n.norm(), f.normal_force_n);
    if (off > (wide ? 60 : kNearMm) && strongest > kLeastN) {
      verdict.force_error_n = std::max(verdict.force_error_n, strongest);
      SetFault(verdict, Text("phantom of %.3f N, %.0f mm", strongest, off));
    }
    if (scene.contacts.empty()) continue;
    matched[nearest].force += f.force_n;
    matched[nearest].center += f.normal_force_n * f.center_mm;
    matched[nearest].weight += f.normal_force_n;
  }
  if (wide) {
    JudgeSum(scene, found, verdict);
    return verdict;
  }
  for (size_t i = 0; i < matched.size(); ++i) {
    const SolidContact& c = scene.contacts[i];
    const double off = (matched[i].force - c.force_n).norm(), size = c.force_n.norm();
    verdict.force_error_n = std::max(verdict.force_error_n, off);
    if (off > std::max(kShare * size, kLeastN))
      SetFault(verdict, Text("force off by %.3f of %.3f N", off, size));
    if (size < kLeastN || matched[i].weight <= 0) continue;
    const double away = (matched[i].center / matched[i].weight - c.center_mm).norm();
    verdict.center_error_mm = std::max(verdict.center_error_mm, away);
    if (away > kCenterMm) SetFault(verdict, Text("center %.1f mm off (%.3f N)", away, size));
  }
  return verdict;
}

}  // namespace taclink
