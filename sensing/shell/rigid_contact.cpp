#include "sensing/shell/rigid_contact.h"

#include <algorithm>
#include <cmath>

#include "sensing/shell/shape_functions.h"

namespace taclink {
namespace {

Vec3 Interpolated(const Eigen::Vector4d& weights, const ElementState& q) {
  Vec3 p = Vec3::Zero();
  for (Eigen::Index i = 0; i < 4; ++i) p += weights[i] * q.segment<3>(6 * i);
  return p;
}

}  // namespace

RigidContact::RigidContact(const NonlinearShell& shell, const RigidContactOptions& options)
    : shell_(shell),
      options_(options),
      body_(RigidSphere{Vec3::Zero(), 0}),
      grown_(body_),
      points_(std::make_shared<const Points>(Spread(shell, options.spacing_mm))),
      held_(options.sticks ? points_->all.size() : 0),
      held_count_(shell.surface().elements.size(), 0) {}

RigidContact::Points RigidContact::Spread(const NonlinearShell& shell, double spacing_mm) {
  Points points;
  const ShellState rest = shell.Rest();
  const auto corner = [&](const ElementState& q, double xi, double eta) {
    return Interpolated(ShapeFunctionsAt(xi, eta).value, q);
  };
  for (size_t e = 0; e < shell.surface().elements.size(); ++e) {
    const ElementState q = shell.StateOf(static_cast<int>(e), rest);
    const auto parts = [&](const Vec3& from, const Vec3& to) {
      return std::max(1, static_cast<int>(std::ceil((to - from).norm() / spacing_mm)));
    };
    const int n1 = parts(corner(q, -1, 0), corner(q, 1, 0)), n2 = parts(corner(q, 0, -1), corner(q, 0, 1));
    points.first.push_back(points.all.size());
    for (int j = 0; j < n2; ++j) {
      for (int i = 0; i < n1; ++i) {
        const double x0 = 2.0 * i / n1 - 1, x1 = 2.0 * (i + 1) / n1 - 1;
        const double y0 = 2.0 * j / n2 - 1, y1 = 2.0 * (j + 1) / n2 - 1;
        const Vec3 diagonal = corner(q, x1, y1) - corner(q, x0, y0);
        const Vec3 other = corner(q, x0, y1) - corner(q, x1, y0);
        points.all.push_back({.weights = ShapeFunctionsAt((x0 + x1) / 2, (y0 + y1) / 2).value,
                              .area_mm2 = 0.5 * diagonal.cross(other).norm()});
      }
    }
  }
  points.first.push_back(points.all.size());
  points.all.shrink_to_fit();
  return points;
}

void RigidContact::SetBody(const RigidBody& body) {
  if (has_body_) moved_mm_ += OriginOf(body) - OriginOf(body_);
  body_ = body;
  grown_ = Grown(body, shell_.surface().thickness_mm / 2);
  has_body_ = true;
}

Vec3 RigidContact::PlaceOf(size_t point, const ElementState& state) const {
  return Interpolated(points_->all[point].weights, state);
}

// No point of the element can be nearer than its centre less its half diagonal.
bool RigidContact::IsFar(size_t element, const ElementState& state) const {
  if (held_count_[element] > 0) return false;
  const Vec3 center = Interpolated(Eigen::Vector4d::Constant(0.25), state);
  double reach2 = 0;
  for (Eigen::Index i = 0; i < 4; ++i) {
    reach2 = std::max(reach2, (state.segment<3>(6 * i) - center).squaredNorm());
  }
  return IsBeyondReach(grown_, center, std::sqrt(reach2));
}

Vec3 RigidContact::SlipOf(size_t point, const Vec3& at_mm) const {
  const HeldPoint& held = *held_[point];
  const Vec3 moved = at_mm - (held.at_mm + moved_mm_);
  return moved - held.normal.dot(moved) * held.normal;
}

void RigidContact::Add(DerivativeOrder order, int element, const ElementState& state,
                       ElementResponse& response) const {
  const auto e = static_cast<size_t>(element);
  if (!has_body_ || IsFar(e, state)) return;
  for (size_t i = points_->first[e]; i < points_->first[e + 1]; ++i) AddPoint(i, state, order, response);
}

void RigidContact::AddPoint(size_t point, const ElementState& state, DerivativeOrder order,
                            ElementResponse& response) const {
  const auto& [weights, area_mm2] = points_->all[point];
  const Vec3 p = PlaceOf(point, state);
  const Gap gap = GapOf(grown_, p);
  if (gap.distance_mm >= 0 && !IsHeld(point)) return;
  const double k = options_.stiffness_n_mm3 * area_mm2;
  const double depth = std::min(gap.distance_mm, 0.0);
  response.energy_nmm += 0.5 * k * depth * depth;
  Vec3 force = k * depth * gap.normal;  // the energy's derivative by the point
  Mat3 stiffness = Mat3::Zero();
  if (depth < 0) stiffness = k * (gap.normal * gap.normal.transpose() + depth * gap.curvature_per_mm);
  if (IsHeld(point)) {
    const Vec3 slip = SlipOf(point, p);
    response.energy_nmm += 0.5 * k * slip.squaredNorm();
    force += k * slip;
    const Vec3& normal = held_[point]->normal;
    stiffness += k * (Mat3::Identity() - normal * normal.transpose());
  }
  if (order == DerivativeOrder::kEnergy) return;
  for (Eigen::Index i = 0; i < 4; ++i) {
    response.gradient.segment<3>(6 * i) += weights[i] * force;
    if (order == DerivativeOrder::kGradient) continue;
    for (Eigen::Index j = 0; j < 4; ++j) {
      response.hessian.block<3, 3>(6 * i, 6 * j) += weights[i] * weights[j] * stiffness;
    }
  }
}

bool RigidContact::Hold(const ShellState& state) {
  if (!options_.sticks || !has_body_) return false;
  bool let_go = false;
  for (size_t e = 0; e < held_count_.size(); ++e) {
    const ElementState q = shell_.StateOf(static_cast<int>(e), state);
    if (IsFar(e, q)) continue;
    for (size_t i = points_->first[e]; i < points_->first[e + 1]; ++i) {
      const Vec3 p = PlaceOf(i, q);
      const Gap gap = GapOf(grown_, p);
      if (gap.distance_mm >= 0) {
        let_go = let_go || held_[i];
        held_count_[e] -= held_[i] ? 1 : 0;
        held_[i].reset();
      } else if (!held_[i]) {
        held_[i] = HeldPoint{p - moved_mm_, gap.normal.normalized()};
        ++held_count_[e];
      }
    }
  }
  return let_go;
}

RigidContact::Grip RigidContact::GripNow() const {
  Grip grip;
  for (size_t e = 0; e < held_count_.size(); ++e) {
    if (held_count_[e] == 0) continue;
    for (size_t i = points_->first[e]; i < points_->first[e + 1]; ++i) {
      if (held_[i]) grip.entries.push_back({e, i, *held_[i]});
    }
  }
  return grip;
}

void RigidContact::Restore(const Grip& grip) {
  held_.assign(held_.size(), {});
  held_count_.assign(held_count_.size(), 0);
  for (const auto& [element, point, held] : grip.entries) {
    held_[point] = held;
    ++held_count_[element];
  }
}

RigidContact::Summary RigidContact::Summarize(const ShellState& state) const {
  Summary summary;
  double pressing = 0;
  for (size_t e = 0; e < held_count_.size(); ++e) {
    const ElementState q = shell_.StateOf(static_cast<int>(e), state);
    if (!has_body_ || IsFar(e, q)) continue;
    for (size_t i = points_->first[e]; i < points_->first[e + 1]; ++i) {
      const double area_mm2 = points_->all[i].area_mm2;
      const Vec3 p = PlaceOf(i, q);
      const Gap gap = GapOf(grown_, p);
      if (gap.distance_mm >= 0) continue;
      const double k = options_.stiffness_n_mm3 * area_mm2;
      Vec3 force = -k * gap.distance_mm * gap.normal;
      if (IsHeld(i)) force -= k * SlipOf(i, p);
      const double weight = -k * gap.distance_mm;
      const Vec3 touched = p - shell_.surface().thickness_mm / 2 * gap.normal.normalized();
      summary.force_n += force;
      summary.moment_nmm += touched.cross(force);
      summary.center_mm += weight * touched;
      pressing += weight;
      summary.area_mm2 += area_mm2;
      summary.penetration_mm = std::max(summary.penetration_mm, -gap.distance_mm);
      ++summary.points;
    }
  }
  if (pressing > 0) summary.center_mm /= pressing;
  return summary;
}

}  // namespace taclink
