#pragma once

#include <algorithm>
#include <array>
#include <cmath>
#include <functional>
#include <random>
#include <vector>

#include "sensing/camera/projection.h"
#include "sensing/core/link_model.h"
#include "sensing/core/markers.h"
#include "tests/support/drawn_vector.h"

namespace taclink {

/// A smooth radial dent (negative: a bulge) that dies out towards the clamped ends, with the small axial and
/// tangential movement that a real skin shows on its flanks.
struct Dent {
  double angle_rad = 0, z_mm = 0, depth_mm = 0, width_mm = 25;
};

inline Vec3 Deform(const LinkModel& model, const std::vector<Dent>& dents, const Vec3& rest) {
  const double angle = std::atan2(rest.y(), rest.x()), radius = rest.head<2>().norm();
  double inward = 0, axial = 0, turned = 0;
  for (const Dent& d : dents) {
    const double across = std::remainder(angle - d.angle_rad, 2 * kPi) * radius, along = rest.z() - d.z_mm;
    const double clamp = std::sin(kPi * std::clamp(rest.z() / model.length_mm, 0.0, 1.0));
    const double u =
        d.depth_mm * clamp * std::exp(-0.5 * (across * across + along * along) / (d.width_mm * d.width_mm));
    inward += u;
    axial -= 0.1 * u * along / d.width_mm;
    turned -= 0.1 * u * across / d.width_mm;
  }
  const double r = std::max(radius - inward, model.tube_outer_radius_mm);
  const double a = angle + turned / radius;
  return {r * std::cos(a), r * std::sin(a), rest.z() + axial};
}

/// Where a marker is that is here at rest.
using Motion = std::function<Vec3(const Vec3& rest)>;

/// A patch at an angle of 1 rad that is dragged.
inline Motion Dragged(const LinkModel& model, const Vec3& by_mm, double z_mm) {
  const Vec3 center = model.PointAtDepth(1, z_mm, model.thickness_mm);
  return [=](const Vec3& rest) -> Vec3 {
    const double off = (rest - center).norm() / 20;
    return rest + std::exp(-0.5 * off * off) * by_mm;
  };
}

/// What the model's cameras see, each of a skin of its own, rightly labeled and with noise.
inline LabelledMarkers LabelsOf(const LinkModel& model, const Motion& top, const Motion& bottom,
                                double noise_px, std::mt19937& random) {
  LabelledMarkers markers;
  std::normal_distribution<double> noise(0, noise_px);
  for (const CameraId id : kBothCameras) {
    const Projector projector(model.nominal_rig[id]);
    for (int m = 0; m < model.markers.count(); ++m) {
      MarkerObservation observation;
      const Vec3 rest = model.RestMarker(m);
      if (const auto pixel = projector.Project(id == CameraId::kTop ? top(rest) : bottom(rest))) {
        observation.seen = true;
        observation.center_px = *pixel + Vec2(noise(random), noise(random));
        observation.covariance_px2 = noise_px * noise_px * Mat2::Identity();
      }
      markers.cameras[Index(id)].push_back(observation);
    }
  }
  return markers;
}

/// True if another part of the same meridian hides part of the marker from a camera on the axis.
inline bool Hidden(const LinkModel& model, const Motion& motion, const Vec3& rest, const Vec3& camera) {
  const Vec3 p = motion(rest);
  const double slope = p.head<2>().norm() / std::abs(p.z() - camera.z());
  const double toward = camera.z() < rest.z() ? -1 : 1;
  for (double z = rest.z() + toward * 3; z > 0 && z < model.length_mm; z += toward * 3) {
    const double angle = std::atan2(rest.y(), rest.x());
    const Vec3 q = motion(model.PointAtDepth(angle, z, model.thickness_mm));
    const double margin = 0.25 * model.markers.diameter_mm;
    if ((q.head<2>().norm() - margin) / std::abs(q.z() - camera.z()) < slope) return true;
  }
  return false;
}

struct SyntheticOptions {
  double noise_px = 0.1;
  double drop = 0;      ///< probability that a marker is not detected
  int false_spots = 0;  ///< per picture
};

/// Of two markers that fall on nearly the same pixel, only the nearer one is seen.
template <typename Distance>
void DropCovered(std::vector<std::pair<Detection, int>>& seen, Distance distance) {
  std::vector<bool> covered(seen.size(), false);
  for (size_t a = 0; a < seen.size(); ++a) {
    for (size_t b = 0; b < seen.size(); ++b) {
      const bool close = a != b && (seen[a].first.center_px - seen[b].first.center_px).norm() < 2;
      if (close && distance(seen[a].second) > distance(seen[b].second)) covered[a] = true;
    }
  }
  size_t kept = 0;
  for (size_t i = 0; i < seen.size(); ++i) {
    if (!covered[i]) seen[kept++] = seen[i];
  }
  seen.resize(kept);
}

/// What a detector would see, shuffled, and which marker each detection is (-1: false).
struct SyntheticView {
  std::array<Detections, kCameraCount> detections;
  std::array<std::vector<int>, kCameraCount> markers;
};

inline SyntheticView SeeMoved(const LinkModel& model, const StereoRig& rig, const Motion& motion,
                              const SyntheticOptions& options, std::mt19937& random) {
  SyntheticView view;
  std::normal_distribution<double> noise(0, options.noise_px);
  std::uniform_real_distribution<double> uniform(0, 1);
  for (const CameraId id : kBothCameras) {
    const Projector projector(rig[id]);
    const double width = rig[id].width_px, height = rig[id].height_px;
    const auto camera_scale = [&](const Vec3& p) {  // px per mm across
      return rig[id].lens.focal_px / (p - projector.center_in_link()).norm();
    };
    std::vector<std::pair<Detection, int>> all;
    for (int i = 0; i < model.markers.count(); ++i) {
      const Vec3 rest = model.RestMarker(i);
      const auto pixel = projector.Project(motion(rest));
      if (!pixel || uniform(random) < options.drop || Hidden(model, motion, rest, projector.center_in_link()))
        continue;
      Detection d;
      d.center_px = *pixel + DrawnVec2([&] { return noise(random); });
      if (d.center_px.x() < 2 || d.center_px.y() < 2 || d.center_px.x() > width - 3 ||
          d.center_px.y() > height - 3)
        continue;
      d.covariance_px2 = options.noise_px * options.noise_px * Mat2::Identity();
      const double scale = camera_scale(rest);
      d.area_px2 = scale * scale * model.markers.diameter_mm * model.markers.diameter_mm * 0.5;
      all.emplace_back(d, i);
    }
    DropCovered(all, [&](int marker) {
      return (motion(model.RestMarker(marker)) - projector.center_in_link()).norm();
    });
    for (int i = 0; i < options.false_spots; ++i) {
      Detection d;
      d.center_px = DrawnVec2([&] { return uniform(random); }).cwiseProduct(Vec2(width, height));
      d.covariance_px2 = options.noise_px * options.noise_px * Mat2::Identity();
      d.area_px2 = 5 + 10 * uniform(random);  // dust
      all.emplace_back(d, -1);
    }
    std::shuffle(all.begin(), all.end(), random);
    for (const auto& [d, marker] : all) {
      view.detections[Index(id)].push_back(d);
      view.markers[Index(id)].push_back(marker);
    }
  }
  return view;
}

inline SyntheticView See(const LinkModel& model, const StereoRig& rig, const std::vector<Dent>& dents,
                         const SyntheticOptions& options, std::mt19937& random) {
  return SeeMoved(model, rig, [&](const Vec3& rest) { return Deform(model, dents, rest); }, options, random);
}

struct LabelScore {
  int shown = 0, right = 0, wrong = 0;  // shown: real markers among the detections, both pictures
};

inline LabelScore Score(const SyntheticView& view, const LabelledMarkers& labels) {
  LabelScore score;
  for (size_t c = 0; c < kCameraCount; ++c) {
    for (const int marker : view.markers[c]) score.shown += marker >= 0 ? 1 : 0;
    for (size_t i = 0; i < labels.cameras[c].size(); ++i) {
      if (!labels.cameras[c][i].seen) continue;
      bool right = false;
      for (size_t k = 0; k < view.markers[c].size(); ++k) {
        right |= view.markers[c][k] == static_cast<int>(i) &&
                 view.detections[c][k].center_px == labels.cameras[c][i].center_px;
      }
      ++(right ? score.right : score.wrong);
    }
  }
  return score;
}

}  // namespace taclink
