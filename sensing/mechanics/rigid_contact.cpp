#include "sensing/mechanics/rigid_contact.h"

#include <algorithm>
#include <cmath>

#include "sensing/mechanics/shape_functions.h"

namespace taclink {
namespace {

Vec3 OriginOf(const RigidBody& body) {
  return std::visit(
      [](const auto& shape) -> Vec3 {
        if constexpr (requires { shape.center_mm; }) {
          return shape.center_mm;
        } else if constexpr (requires { shape.face_center_mm; }) {
          return shape.face_center_mm;
        } else {
          return shape.point_mm;
        }
      },
      body);
}

Vec3 Interpolated(const Eigen::Vector4d& weights, double offset, const ElementState& q) {
  Vec3 p = Vec3::Zero();
  for (Eigen::Index i = 0; i < 4; ++i) {
    p += weights[i] * (q.segment<3>(6 * i) + offset * q.segment<3>(6 * i + 3));
  }
  return p;
}

// A force and a stiffness at a point, on the corners that carry it.
void AddPoint(const Eigen::Vector4d& weights, double offset_mm, const Vec3& force, const Mat3& stiffness,
              bool with_hessian, ElementResponse& response) {
  for (Eigen::Index i = 0; i < 4; ++i) {
    response.gradient.segment<3>(6 * i) += weights[i] * force;
    response.gradient.segment<3>(6 * i + 3) += offset_mm * weights[i] * force;
  }
  if (!with_hessian) return;
  for (Eigen::Index i = 0; i < 4; ++i) {
    for (Eigen::Index j = 0; j < 4; ++j) {
      const Mat3 block = weights[i] * weights[j] * stiffness;
      response.hessian.block<3, 3>(6 * i, 6 * j) += block;
      response.hessian.block<3, 3>(6 * i, 6 * j + 3) += offset_mm * block;
      response.hessian.block<3, 3>(6 * i + 3, 6 * j) += offset_mm * block;
      response.hessian.block<3, 3>(6 * i + 3, 6 * j + 3) += offset_mm * offset_mm * block;
    }
  }
}

}  // namespace

RigidContact::RigidContact(const NonlinearShell& shell, const RigidContactOptions& options)
    : shell_(shell), options_(options), body_(RigidSphere{Vec3::Zero(), 0}) {
  held_count_.assign(shell.surface().elements.size(), 0);
  const ShellState rest = shell.Rest();
  const auto corner = [&](const ElementState& q, double xi, double eta) {
    return Interpolated(ShapeFunctionsAt(xi, eta).value, options.offset_mm, q);
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
  has_body_ = true;
}

Vec3 RigidContact::PointOf(const Sample& sample, const ElementState& state) const {
  return Interpolated(sample.weights, options_.offset_mm, state);
}

// No point of the element can be nearer than its centre less its half diagonal.
bool RigidContact::IsFar(int element, const ElementState& state) const {
  if (held_count_[static_cast<size_t>(element)] > 0) return false;
  const Vec3 center = Interpolated(Eigen::Vector4d::Constant(0.25), options_.offset_mm, state);
  double reach2 = 0;
  for (Eigen::Index i = 0; i < 4; ++i) {
    const Vec3 p = state.segment<3>(6 * i) + options_.offset_mm * state.segment<3>(6 * i + 3);
    reach2 = std::max(reach2, (p - center).squaredNorm());
  }
  return IsBeyondReach(body_, center, std::sqrt(reach2));
}

Vec3 RigidContact::SlipOf(const Sample& sample, const Vec3& point_mm) const {
  const Vec3 moved = point_mm - (sample.held->at_mm + moved_mm_);
  return moved - sample.held->normal.dot(moved) * sample.held->normal;
}

void RigidContact::Add(DerivativeOrder order, int element, const ElementState& state,
                       ElementResponse& response) const {
  if (!has_body_ || IsFar(element, state)) return;
  for (const Sample& sample : samples_[static_cast<size_t>(element)]) {
    const Vec3 p = PointOf(sample, state);
    const Gap gap = GapOf(body_, p);
    if (gap.distance_mm >= 0 && !sample.held) continue;
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
    if (order != DerivativeOrder::kEnergy) {
      AddPoint(sample.weights, options_.offset_mm, force, stiffness, order == DerivativeOrder::kHessian,
               response);
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
      const Gap gap = GapOf(body_, p);
      if (gap.distance_mm >= 0) {
        let_go = let_go || sample.held;
        held_count_[e] -= sample.held ? 1 : 0;
        sample.held.reset();
      } else if (!sample.held) {
        sample.held = Sample::Held{p - moved_mm_, gap.normal.normalized()};
        ++held_count_[e];
      }
    }
  }
  return let_go;
}

RigidContact::Summary RigidContact::Summarize(const ShellState& state) const {
  Summary summary;
  double pressing = 0;
  for (size_t e = 0; e < samples_.size(); ++e) {
    const ElementState q = shell_.StateOf(static_cast<int>(e), state);
    if (!has_body_ || IsFar(static_cast<int>(e), q)) continue;
    for (const Sample& sample : samples_[e]) {
      const Vec3 p = PointOf(sample, q);
      const Gap gap = GapOf(body_, p);
      if (gap.distance_mm >= 0) continue;
      const double k = options_.stiffness_n_mm3 * sample.area_mm2;
      Vec3 force = -k * gap.distance_mm * gap.normal;
      if (sample.held) force -= k * SlipOf(sample, p);
      const double weight = -k * gap.distance_mm;
      summary.force_n += force;
      summary.moment_nmm += p.cross(force);
      summary.center_mm += weight * p;
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
