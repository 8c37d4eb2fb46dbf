#include "sensing/force/literal_estimator.h"

#include <cmath>

#include "sensing/force/compliance_estimator.h"
#include "sensing/mechanics/nonlinear_shell.h"

namespace taclink {

namespace {

constexpr double kLeastForceN = 0.03;  // of a marker that is told as loaded

}  // namespace

struct LiteralEstimator::Solver {
  Solver(const LinkModel& link, int refinement)
      : model(link), mesh(MakeShellMesh(link, refinement)), shell(SkinSurface(mesh), link.material) {
    Eigen::VectorXd gradient;
    stiffness = shell.Pattern();
    shell.Hessian(shell.Rest(), {}, gradient, stiffness);
    const FollowerPressure unit(link.thickness_mm, 1);
    const ElementLoad* loads[] = {&unit};
    shell.Gradient(shell.Rest(), loads, per_pressure);
  }

  // Between the markers' nodes of a finer mesh: bilinear, and zero at the clamped ends.
  Vec3 DisplacementAt(const SkinShape& shape, int column, int row) const {
    const int k = mesh.refinement;
    const int path = column / k, ring = row / k - 1;
    const double a = static_cast<double>(column % k) / k, b = static_cast<double>(row % k) / k;
    const auto at = [&](int p, int r) -> Vec3 {
      if (r < 0 || r >= model.markers.rings()) return Vec3::Zero();
      const Vec3& u =
          shape.displacements_mm[static_cast<size_t>(model.MarkerIndex(p % model.markers.paths, r))];
      return u.allFinite() ? u : Vec3(Vec3::Zero());
    };
    return (1 - a) * (1 - b) * at(path, ring) + a * (1 - b) * at(path + 1, ring) +
           (1 - a) * b * at(path, ring + 1) + a * b * at(path + 1, ring + 1);
  }

  LinkModel model;
  ShellMesh mesh;
  NonlinearShell shell;
  Eigen::SparseMatrix<double> stiffness;  // lower half
  Eigen::VectorXd per_pressure;           // minus the load of 1 MPa
  Eigen::VectorXd displacement, force;
};

LiteralEstimator::LiteralEstimator(const LinkModel& model, const ForceOptions& options)
    : solver_(std::make_unique<Solver>(model, options.refinement > 0 ? options.refinement : 1)) {}
LiteralEstimator::~LiteralEstimator() = default;

void LiteralEstimator::Estimate(const SkinShape& shape, double pressure_mpa, NodalForces& forces) {
  Solver& s = *solver_;
  ClearForces(s.model.markers.count(), ForceModel::kLiteral, forces);
  s.displacement.setZero(s.shell.dof_count());
  for (int node = 0; node < s.mesh.node_count(); ++node) {
    if (s.mesh.IsClamped(node)) continue;
    s.displacement.segment<3>(s.shell.Dof(node, 0)) =
        s.DisplacementAt(shape, s.mesh.Column(node), s.mesh.Row(node));
  }
  s.force = s.stiffness.selfadjointView<Eigen::Lower>() * s.displacement + pressure_mpa * s.per_pressure;
  for (int m = 0; m < s.model.markers.count(); ++m) {
    const Vec3 f = s.force.segment<3>(s.shell.Dof(s.mesh.NodeOfMarker(s.model, m), 0));
    if (!(f.norm() >= kLeastForceN)) continue;
    forces.forces_n[static_cast<size_t>(m)] = f;
    forces.loaded.push_back(m);
  }
  const auto rows = static_cast<Eigen::Index>(3 * forces.loaded.size());
  if (forces.loaded_covariance.rows() < rows) forces.loaded_covariance.setZero(rows, rows);
}

}  // namespace taclink
