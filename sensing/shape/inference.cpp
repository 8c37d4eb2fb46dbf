#include "sensing/shape/inference.h"

namespace taclink {

void InferUnseen(const LinkModel& model, double sigma_mm, SkinShape& shape) {
  const auto& z = model.markers.rings_z_mm;
  for (int path = 0; path < model.markers.paths; ++path) {
    double z_before = 0;
    Vec3 u_before = Vec3::Zero();
    for (int ring = 0; ring < model.markers.rings(); ++ring) {
      const auto i = static_cast<size_t>(model.MarkerIndex(path, ring));
      if (shape.sources[i] != MarkerSource::kInferred) {
        z_before = z[static_cast<size_t>(ring)];
        u_before = shape.displacements_mm[i];
        continue;
      }
      double z_after = model.length_mm;
      Vec3 u_after = Vec3::Zero();
      for (int next = ring + 1; next < model.markers.rings(); ++next) {
        const auto k = static_cast<size_t>(model.MarkerIndex(path, next));
        if (shape.sources[k] == MarkerSource::kInferred) continue;
        z_after = z[static_cast<size_t>(next)];
        u_after = shape.displacements_mm[k];
        break;
      }
      const double part = (z[static_cast<size_t>(ring)] - z_before) / (z_after - z_before);
      shape.displacements_mm[i] = u_before + part * (u_after - u_before);
      shape.positions_mm[i] += shape.displacements_mm[i];
      shape.covariances_mm2[i] = sigma_mm * sigma_mm * Mat3::Identity();
    }
  }
}

}  // namespace taclink
