#include "sensing/core/similar_skin.h"

#include <cmath>

namespace taclink {
namespace {

constexpr double kUsualLengthMm = 11.5704, kUsualForceN = 1.225;  // of the shipped cylinder

StereoRig Scaled(StereoRig rig, double scale) {
  for (CameraModel& camera : rig.cameras) camera.camera_from_link.translation *= scale;
  return rig;
}

LinkModel Scaled(LinkModel model, double scale) {
  model.length_mm *= scale;
  model.thickness_mm *= scale;
  model.profile = model.profile.Scaled(scale);
  model.profile_depth_mm *= scale;
  for (double& z : model.markers.rings_z_mm) z *= scale;
  model.markers.diameter_mm *= scale;
  model.markers.center_depth_mm *= scale;
  model.tube_outer_radius_mm *= scale;
  model.nominal_rig = Scaled(model.nominal_rig, scale);
  return model;
}

}  // namespace

double DecayLengthMm(const LinkModel& model) {
  const double radius = model.PointAtDepth(0, model.length_mm / 2, model.thickness_mm / 2).head<2>().norm();
  return std::sqrt(radius * model.thickness_mm);
}

double LengthUnit(const LinkModel& model) {
  return DecayLengthMm(model) / kUsualLengthMm;
}

double ForceUnit(const LinkModel& model) {
  return model.material.youngs_modulus_mpa * model.thickness_mm * model.thickness_mm / kUsualForceN;
}

SimilarSkin::SimilarSkin(const LinkModel& real, const StereoRig& real_rig)
    : scale(1 / LengthUnit(real)), model(Scaled(real, scale)), rig(Scaled(real_rig, scale)) {}

}  // namespace taclink
