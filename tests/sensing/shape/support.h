#pragma once

#include <functional>
#include <random>
#include <vector>

#include "sensing/camera/projection.h"
#include "sensing/core/link_model.h"
#include "sensing/core/markers.h"
#include "sensing/simulation/simulated_skin.h"

namespace taclink {

/// True marker centres under pushes (angle, z as a part of the length, depth), on the simulation's finer
/// mesh.
struct Push {
  double angle_rad, z_part, depth_mm;
};

inline std::vector<Vec3> TrueMarkers(const LinkModel& model, const std::vector<Push>& pushes,
                                     double pressure_mpa = 0) {
  Scene scene;
  scene.name = "test";
  scene.model = model.name;
  scene.skin = SkinKind::kLinear;
  scene.duration_s = 2;
  scene.pressure = {{0, pressure_mpa * 1e3}};
  for (const Push& push : pushes) {
    SceneContact contact;
    contact.at.angle_rad = push.angle_rad;
    contact.at.z_mm = push.z_part * model.length_mm;
    contact.depth_mm = push.depth_mm;
    contact.end_s = 2;
    scene.contacts.push_back(contact);
  }
  SkinTruth truth;
  SimulatedSkin::Make(model, scene).value()->Evaluate(1, truth);
  return truth.marker_mm;
}

/// Right labels of all markers with Gaussian noise; `bias(camera, marker)` adds a fixed shift.
class Eyes {
 public:
  explicit Eyes(const StereoRig& rig, unsigned seed = 1)
      : projectors_{Projector(rig[CameraId::kTop]), Projector(rig[CameraId::kBottom])}, random_(seed) {}

  std::function<Vec2(size_t, size_t)> bias;

  LabelledMarkers See(const std::vector<Vec3>& markers, double sigma_px) {
    LabelledMarkers labels;
    std::normal_distribution<double> noise(0, sigma_px);
    for (size_t c = 0; c < kCameraCount; ++c) {
      for (size_t m = 0; m < markers.size(); ++m) {
        const auto pixel = projectors_[c].Project(markers[m]);
        MarkerObservation seen;
        seen.seen = pixel.has_value();
        if (pixel) seen.center_px = *pixel + Vec2(noise(random_), noise(random_));
        if (bias) seen.center_px += bias(c, m);
        seen.covariance_px2 = sigma_px * sigma_px * Mat2::Identity();
        labels.cameras[c].push_back(seen);
      }
    }
    return labels;
  }

 private:
  std::vector<Projector> projectors_;
  std::mt19937 random_;
};

}  // namespace taclink
