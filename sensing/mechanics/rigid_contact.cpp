#include "sensing/mechanics/rigid_contact.h"

#include <algorithm>
#include <cmath>

#include "sensing/mechanics/shape_functions.h"

namespace taclink {
namespace {

Vec3 Interpolated(const Eigen::Vector4d& weights, const ElementState& q) {
  Vec3 p = Vec3::Zero();
  for (Eigen::Index i = 0; i < 4; ++i) p += weights[i] * q.segment<3>(6 * i);
  return p;
}

}  // namespace

RigidContact::RigidContact(const NonlinearShell& shell, const RigidContactOptions& options)
    : shell_(shell), options_(options), body_(RigidSphere{Vec3::Zero(), 0}), grown_(body_) {
  held_count_.assign(shell.surface().elements.size(), 0);
  const ShellState rest = shell.Rest();
  const auto corner = [&](const ElementState& q, double xi, double eta) {
    return Interpolated(ShapeFunctionsAt(xi, eta).value, q);
  };
  for (size_t e = 0; e < shell.surface().elements.size(); ++e) {
    const ElementState q = shell.StateOf(static_cast<int>(e), rest);
    const auto parts = [&](const Vec3& from, const Vec3& to) {
      return std::max(1, static_cast<int>(std::ceil((to - from).norm() / options.spacing_mm)));
    };
    const int n1 = parts(corner(q, -1, 0), corner(q, 1, 0)), n2 = parts(corner(q, 0, -1), corner(q, 0, 1));
    std::vector<Sample>& samples = samples_.emplace_back();
    for (int j = 0; j < n2; ++j) {
      for (int i = 0; i < n1; ++i) {
        const double x0 = 2.0 * i / n1 - 1, x1 = 2.0 * (i + 1) / n1 - 1;
        const double y0 = 2.0 * j / n2 - 1, y1 = 2.0 * (j + 1) / n2 - 1;
        const Vec3 diagonal = corner(q, x1, y1) - corner(q, x0, y0);
        const Vec3 other = corner(q, x0, y1) - corner(q, x1, y0);
        samples.push_back({.weights = ShapeFunctionsAt((x0 + x1) / 2, (y0 + y1) / 2).value,
                           .area_mm2 = 0.5 * diagonal.cross(other).norm(),
                           .held = {}});
      }
    }
  }
}

void RigidContact::SetBody(const RigidBody& body) {
  if (has_body_) moved_mm_ += OriginOf(body) - OriginOf(body_);
  body_ = body;
  grown_ = Grown(body, shell_.surface().thickness_mm / 2);
  has_body_ = true;
}

Vec3 RigidContact::PointOf(const Sample& sample, const ElementState& state) const {
  return Interpolated(sample.weights, state);
}

// No point of the element can be nearer than its centre less its half diagonal.
bool RigidContact::IsFar(int element, const ElementState& state) const {
  if (held_count_[static_cast<size_t>(element)] > 0) return false;
  const Vec3 center = Interpolated(Eigen::Vector4d::Constant(0.25), state);
  double reach2 = 0;
  for (Eigen::Index i = 0; i < 4; ++i) {
    reach2 = std::max(reach2, (state.segment<3>(6 * i) - center).squaredNorm());
  }
  return IsBeyondReach(grown_, center, std::sqrt(reach2));
}

Vec3 RigidContact::SlipOf(const Sample& sample, const Vec3& point_mm) const {
  const Vec3 moved = point_mm - (sample.held->at_mm + moved_mm_);
  return moved - sample.held->normal.dot(moved) * sample.held->normal;
}

void RigidContact::Add(DerivativeOrder order, int element, const ElementState& state,
                       ElementResponse& response) const {
  if (!has_body_ || IsFar(element, state)) return;
  for (const Sample& sample : samples_[static_cast<size_t>(element)])
    AddPoint(sample, state, order, response);
}

void RigidContact::AddPoint(const Sample& sample, const ElementState& state, DerivativeOrder order,
                            ElementResponse& response) const {
  const Vec3 p = PointOf(sample, state);
  const Gap gap = GapOf(grown_, p);
  if (gap.distance_mm >= 0 && !sample.held) return;
  const double k = options_.stiffness_n_mm3 * sample.area_mm2;
  const double depth = std::min(gap.distance_mm, 0.0);
  response.energy_nmm += 0.5 * k * depth * depth;
  Vec3 force = k * depth * gap.normal;  // the energy's derivative by the point
  Mat3 stiffness = Mat3::Zero();
  if (depth < 0) stiffness = k * (gap.normal * gap.normal.transpose() + depth * gap.curvature_per_mm);
  if (sample.held) {
    const Vec3 slip = SlipOf(sample, p);
    response.energy_nmm += 0.5 * k * slip.squaredNorm();
    force += k * slip;
    stiffness += k * (Mat3::Identity() - sample.held->normal * sample.held->normal.transpose());
  }
  if (order == DerivativeOrder::kEnergy) return;
  for (Eigen::Index i = 0; i < 4; ++i) {
    response.gradient.segment<3>(6 * i) += sample.weights[i] * force;
    if (order == DerivativeOrder::kGradient) continue;
    for (Eigen::Index j = 0; j < 4; ++j) {
      response.hessian.block<3, 3>(6 * i, 6 * j) += sample.weights[i] * sample.weights[j] * stiffness;
    }
  }
}

bool RigidContact::Hold(const ShellState& state) {
  if (!options_.sticks || !has_body_) return false;
  bool let_go = false;
  for (size_t e = 0; e < samples_.size(); ++e) {
    const ElementState q = shell_.StateOf(static_cast<int>(e), state);
    if (IsFar(static_cast<int>(e), q)) continue;
    for (Sample& sample : samples_[e]) {
      const Vec3 p = PointOf(sample, q);
      const Gap gap = GapOf(grown_, p);
      if (gap.distance_mm >= 0) {
        let_go = let_go || sample.held;
        held_count_[e] -= sample.held ? 1 : 0;
        sample.held.reset();
      } else if (!sample.held) {
        sample.held = HeldPoint{p - moved_mm_, gap.normal.normalized()};
        ++held_count_[e];
      }
    }
  }
  return let_go;
}

RigidContact::Grip RigidContact::GripNow() const {
  Grip grip;
  for (size_t e = 0; e < samples_.size(); ++e) {
    if (held_count_[e] == 0) continue;
    for (size_t i = 0; i < samples_[e].size(); ++i) {
      if (samples_[e][i].held) grip.entries.push_back({e, i, *samples_[e][i].held});
    }
  }
  return grip;
}

void RigidContact::Restore(const Grip& grip) {
  for (size_t e = 0; e < samples_.size(); ++e) {
    if (held_count_[e] == 0) continue;
    for (Sample& sample : samples_[e]) sample.held.reset();
    held_count_[e] = 0;
  }
  for (const auto& [element, sample, held] : grip.entries) {
    samples_[element][sample].held = held;
    ++held_count_[element];
  }
}

RigidContact::Summary RigidContact::Summarize(const ShellState& state) const {
  Summary summary;
  double pressing = 0;
  for (size_t e = 0; e < samples_.size(); ++e) {
    const ElementState q = shell_.StateOf(static_cast<int>(e), state);
    if (!has_body_ || IsFar(static_cast<int>(e), q)) continue;
    for (const Sample& sample : samples_[e]) {
      const Vec3 p = PointOf(sample, q);
      const Gap gap = GapOf(grown_, p);
      if (gap.distance_mm >= 0) continue;
      const double k = options_.stiffness_n_mm3 * sample.area_mm2;
      Vec3 force = -k * gap.distance_mm * gap.normal;
      if (sample.held) force -= k * SlipOf(sample, p);
      const double weight = -k * gap.distance_mm;
      const Vec3 touched = p - shell_.surface().thickness_mm / 2 * gap.normal.normalized();
      summary.force_n += force;
      summary.moment_nmm += touched.cross(force);
      summary.center_mm += weight * touched;
      pressing += weight;
      summary.area_mm2 += sample.area_mm2;
      summary.penetration_mm = std::max(summary.penetration_mm, -gap.distance_mm);
      ++summary.points;
    }
  }
  if (pressing > 0) summary.center_mm /= pressing;
  return summary;
}

}  // namespace taclink
