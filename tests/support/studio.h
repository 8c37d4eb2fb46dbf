#pragma once

#include <opencv2/core.hpp>
#include <string>
#include <vector>

#include "sensing/core/link_model.h"
#include "sensing/simulation/renderer.h"
#include "sensing/simulation/simulated_skin.h"

namespace taclink {

/// Turns a camera by a rotation vector in its own frame and moves it in the link's.
inline void Misalign(CameraModel& camera, const Vec3& turn_deg, const Vec3& move_mm) {
  const Vec3 center = camera.camera_from_link.Inverse().translation + move_mm;
  const Vec3 turn = turn_deg * RadFromDeg(1);
  if (turn.norm() > 0) {
    camera.camera_from_link.rotation =
        Mat3(Eigen::AngleAxisd(turn.norm(), turn.normalized())) * camera.camera_from_link.rotation;
  }
  camera.camera_from_link.translation = -(camera.camera_from_link.rotation * center);
}

using PicturePair = std::array<cv::Mat, kCameraCount>;  ///< by camera

/// What a rig's cameras see of the skin, by the simulation.
class Studio {
 public:
  explicit Studio(LinkModel model) : model_(std::move(model)) {}

  /// `contacts` is a scene file's list of contacts, empty: an untouched skin. Taken at 1 s.
  SkinTruth Truth(const std::string& contacts = "", double pressure_kpa = 0) const {
    Scene scene;
    if (!contacts.empty()) {
      scene = ParseScene("scene", "taclink_scene: 1\nname: s\nmodel: " + model_.name +
                                      "\nduration_s: 2\ncontacts:\n" + contacts)
                  .value();
    }
    scene.skin = SkinKind::kLinear;
    scene.duration_s = 2;
    scene.pressure = {{0, pressure_kpa}};
    SkinTruth truth;
    SimulatedSkin::Make(model_, scene).value()->Evaluate(1, truth);
    return truth;
  }

  PicturePair Take(const StereoRig& rig, const SkinTruth& truth, uint64_t seed = 1) const {
    Renderer renderer(model_, rig, CameraEffects{}, seed);
    PicturePair pictures;
    for (const CameraId id : kBothCameras) renderer.Render(truth, id, pictures[Index(id)]);
    return pictures;
  }

 private:
  LinkModel model_;
};

}  // namespace taclink
