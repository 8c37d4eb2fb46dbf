#include "sensing/estimation/thesis_force.h"

#include <cmath>

#include "sensing/shell/element_load.h"
#include "sensing/shell/nonlinear_shell.h"

namespace taclink {
namespace {

constexpr double kCameraErrorMm = 0.8;     // of the thesis' own cameras, chapter 4
constexpr double kThresholdNPerMm = 0.02;  // below (6.6)

}  // namespace

struct ThesisForce::Solver {
  Solver(const LinkModel& link, int refinement)
      : model(link), mesh(MakeShellMesh(link, refinement)), shell(SkinSurface(mesh), link.material) {
    Eigen::VectorXd gradient;
    stiffness = shell.Pattern();
    shell.Hessian(shell.Rest(), {}, gradient, stiffness);
    const FollowerPressure unit(1);
    const ElementLoad* loads[] = {&unit};
    shell.Gradient(shell.Rest(), loads, per_pressure);
  }

  // Between the markers' nodes of a finer mesh: bilinear, and zero at the clamped ends.
  Vec3 DisplacementAt(const Eigen::VectorXd& markers_mm, int column, int row) const {
    const int k = mesh.refinement;
    const int path = column / k, ring = row / k - 1;
    const double a = static_cast<double>(column % k) / k, b = static_cast<double>(row % k) / k;
    const auto at = [&](int p, int r) -> Vec3 {
      if (r < 0 || r >= model.markers.rings()) return Vec3::Zero();
      const Vec3 u = markers_mm.segment<3>(3 * model.MarkerIndex(p % model.markers.paths, r));
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

ThesisForce::ThesisForce(const LinkModel& model, int refinement)
    : solver_(std::make_unique<Solver>(model, refinement)) {}
ThesisForce::~ThesisForce() = default;

void ThesisForce::Estimate(const Eigen::VectorXd& displacements_mm, double pressure_mpa,
                           NodalForces& forces) {
  Solver& s = *solver_;
  const auto markers = static_cast<size_t>(s.model.markers.count());
  forces.model = ForceModel::kLiteral;
  forces.forces_n.assign(markers, Vec3::Zero());
  forces.sigmas_n.assign(markers, 0);
  forces.loaded.clear();
  forces.residual = forces.region_residual = forces.camera_shift_mm = 0;
  forces.limits_n.clear();
  forces.limit_around_n = 0;
  s.displacement.setZero(s.shell.dof_count());
  for (int node = 0; node < s.mesh.node_count(); ++node) {
    if (s.mesh.IsClamped(node)) continue;
    s.displacement.segment<3>(s.shell.Dof(node, 0)) =
        s.DisplacementAt(displacements_mm, s.mesh.Column(node), s.mesh.Row(node));
  }
  s.force = s.stiffness.selfadjointView<Eigen::Lower>() * s.displacement + pressure_mpa * s.per_pressure;
  for (size_t m = 0; m < markers; ++m) {
    const auto marker = static_cast<int>(m);
    const Vec3 f = s.force.segment<3>(s.shell.Dof(s.mesh.NodeOfMarker(s.model, marker), 0));
    const double angle = s.model.PathAngle(s.model.PathOf(marker));
    const Vec3 outward(std::cos(angle), std::sin(angle), 0);
    const double radial_n = f.dot(outward);
    if (!(-radial_n > kThresholdNPerMm * kCameraErrorMm)) continue;
    forces.forces_n[m] = radial_n * outward;
    forces.loaded.push_back(marker);
  }
}

}  // namespace taclink
