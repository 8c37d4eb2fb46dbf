#pragma once

#include <gtest/gtest.h>

#include <cmath>
#include <optional>

#include "sensing/estimation/skin_estimator.h"
#include "sensing/model/model_file.h"
#include "sensing/shell/body_force.h"
#include "sensing/shell/element_load.h"
#include "sensing/shell/equilibrium.h"

namespace taclink {

// A dead load on the outer wall's nodes around a place, or all around if no angle is given, on a finer mesh
// than the estimator's.
struct Pushed {
  Eigen::VectorXd markers_mm;
  bool ok = false;
};
inline Pushed Push(const LinkModel& model, double kpa, std::optional<double> angle, double z, double force_n,
                   double width_mm, const Vec3& specific_force_mps2 = Vec3::Zero()) {
  const ShellMesh mesh = MakeShellMesh(model, 2);
  const NonlinearShell shell(SkinSurface(mesh), model.material);
  EquilibriumSolver solver(shell, {.tolerance_n = 1e-7});
  const std::vector<Eigen::Vector4d> areas_mm2 = CornerAreas(shell.surface());
  ShellState state = shell.Rest();
  Pushed pushed;
  for (int step = 1; step <= 8; ++step) {
    const FollowerPressure pressure(kpa * 1e-3 * step / 8);
    const BodyForce weight(areas_mm2, model.MassPerArea() * specific_force_mps2 * step / 8);
    const ElementLoad* loads[] = {&pressure, &weight};
    if (!solver.Solve(loads, {}, state).ok()) return pushed;
  }
  const FollowerPressure pressure(kpa * 1e-3);
  const BodyForce weight(areas_mm2, model.MassPerArea() * specific_force_mps2);
  const ElementLoad* loads[] = {&pressure, &weight};
  const Vec3 center = model.PointAtDepth(angle.value_or(0), z, model.thickness_mm / 2);
  const Vec3 inward = -model.OutwardNormal(angle.value_or(0), z);
  Eigen::VectorXd share = Eigen::VectorXd::Zero(mesh.node_count());
  for (int node = mesh.columns; node < mesh.node_count() - mesh.columns; ++node) {
    const auto i = static_cast<size_t>(node);
    const double off2 = angle ? (mesh.mid_mm[i] - center).squaredNorm() : std::pow(mesh.mid_mm[i].z() - z, 2);
    share[node] = mesh.areas_mm2[i] * std::exp(-off2 / (2 * width_mm * width_mm));
  }
  share /= share.sum();
  for (int step = 1; step <= 8; ++step) {
    Eigen::VectorXd dead = Eigen::VectorXd::Zero(shell.dof_count());
    for (int node = 0; node < mesh.node_count(); ++node) {
      if (const int dof = shell.Dof(node, 0); dof >= 0)
        dead.segment<3>(dof) =
            force_n * step / 8 * share[node] * (angle ? inward : -mesh.normals[static_cast<size_t>(node)]);
    }
    if (!solver.Solve(loads, dead, state).ok()) return pushed;
  }
  MarkerMap(model, mesh).Displacements(state, pushed.markers_mm);
  pushed.ok = true;
  return pushed;
}

inline SkinObservation Observe(const Eigen::VectorXd& markers_mm, double kpa, double sigma_mm) {
  SkinObservation observation;
  for (Eigen::Index m = 0; m < markers_mm.size() / 3; ++m) {
    observation.markers.displacement_mm.push_back(markers_mm.segment<3>(3 * m));
    observation.markers.information.push_back(Mat3::Identity() / (sigma_mm * sigma_mm));
  }
  observation.loads = {kpa * 1e-3, 3e-5};
  return observation;
}

class SkinEstimatorTest : public ::testing::Test {
 protected:
  static LinkModel Rubber() {
    LinkModel model = LoadLinkModel("cylinder").value();
    model.material = {.youngs_modulus_mpa = 0.1, .poisson_ratio = 0.5, .law = MaterialLaw::kNeoHookean};
    return model;
  }
  const LinkModel model_ = Rubber();
  SkinEstimator estimator_{model_};
  SkinEstimate estimate_;
};

}  // namespace taclink
