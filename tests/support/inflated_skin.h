#pragma once

#include <gtest/gtest.h>

#include <random>
#include <string>
#include <vector>

#include "sensing/core/link_model.h"
#include "sensing/identification/material_fit.h"
#include "sensing/shell/pressed_skin.h"
#include "tests/support/drawn_vector.h"

namespace taclink {

/// Markers' displacements of a skin of that material under a gauge pressure: the nonlinear shell on a mesh of
/// its own. Without noise.
inline std::vector<Vec3> InflatedMarkers(LinkModel model, const Material& material, double pressure_mpa,
                                         int refinement = 4) {
  model.material = material;
  PressedSkin skin(model, {.refinement = refinement});
  EXPECT_TRUE(skin.Inflate(pressure_mpa).ok());
  std::vector<Vec3> displacements;
  for (int m = 0; m < model.markers.count(); ++m)
    displacements.push_back(skin.Marker(m) - model.RestMarker(m));
  return displacements;
}

/// The same as a record, with noise that is three times larger along the axis.
inline InflationRecord NoisyRecord(const std::vector<Vec3>& displacements_mm, double pressure_mpa,
                                   double sigma_mm, std::mt19937& random) {
  std::normal_distribution<double> normal;
  const Vec3 sigmas = sigma_mm * Vec3(1, 1, 3);
  InflationRecord record{.name = std::to_string(pressure_mpa * 1e3) + " kPa", .pressure_mpa = pressure_mpa};
  for (const Vec3& u : displacements_mm) {
    const Vec3 noise = sigmas.cwiseProduct(DrawnVec3([&] { return normal(random); }));
    record.markers.push_back({u + noise, sigmas.cwiseAbs2().cwiseInverse().asDiagonal()});
  }
  return record;
}

}  // namespace taclink
