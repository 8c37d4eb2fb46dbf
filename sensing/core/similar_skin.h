#pragma once

#include "sensing/core/camera_model.h"
#include "sensing/core/link_model.h"

namespace taclink {

/// sqrt(R t) of the mid-surface at mid-length, mm: the length over which a dent in the skin decays
/// [calladine1983].
double DecayLengthMm(const LinkModel& model);

/// That in terms of the shipped cylinder's: what lengths that go with the skin's size are multiplied by.
double LengthUnit(const LinkModel& model);

/// E t^2 in terms of the shipped cylinder's with 0.1 MPa: likewise of forces.
double ForceUnit(const LinkModel& model);

/// Skins that differ in nothing but their size, cameras' places included, give the same pictures. What finds
/// and follows labels therefore works on the similar skin of the shipped cylinder's size, with tolerances in
/// mm of that, whatever the size of the real one.
struct SimilarSkin {
  SimilarSkin(const LinkModel& model, const StereoRig& rig);

  double scale = 1;  ///< its lengths by the real ones
  LinkModel model;   ///< geometry alone: the material is the real one's
  StereoRig rig;
};

}  // namespace taclink
