#pragma once

#include <Eigen/Core>
#include <array>
#include <vector>

#include "sensing/core/geometry.h"
#include "sensing/core/link_model.h"

namespace taclink {

/// Where the points are that the cameras see of the markers' domes, which change as the walls under them tilt
/// (see SeenOfDome). One thread; no allocation after construction.
class DomeLooks {
 public:
  /// `cameras_mm`: where they are, link frame, by CameraId.
  DomeLooks(const LinkModel& model, const std::array<Vec3, kCameraCount>& cameras_mm);

  /// The skin displaced by `u` (stacked, link frame) from the model. Returns the longest change of an
  /// offset, mm.
  double Update(const Eigen::VectorXd& u);

  /// From a marker's centre to the point that is seen of it, link frame, mm.
  const Vec3& Offset(size_t marker, size_t camera) const { return offsets_[marker][camera]; }

 private:
  Vec3 NormalAt(int marker) const;
  double Look(int marker, const Vec3& inward);

  const int paths_, rings_;
  const std::array<Vec3, kCameraCount> cameras_mm_;
  const double rise_mm_;
  std::vector<Vec3> rest_mm_, rest_inward_;  // of the model
  std::vector<Vec3> ends_mm_;                // clamped, first and last: by path, then by end
  std::vector<Vec3> places_mm_, rest_normals_;
  std::vector<std::array<Vec3, kCameraCount>> offsets_;
  std::vector<char> moved_;
};

}  // namespace taclink
