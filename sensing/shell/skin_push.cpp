#include "sensing/shell/skin_push.h"

#include <Eigen/Cholesky>
#include <algorithm>
#include <cmath>
#include <string>
#include <vector>

#include "sensing/shell/linear_shell.h"
#include "sensing/shell/pressed_skin.h"

namespace taclink {
namespace {

constexpr double kMaxPressureMpa = 0.02;  // several times what any skin of this kind bears
constexpr double kMaxSpecificForceMps2 = 100;

constexpr double kStartMm = 0.1;  // of the disc, outside the skin
constexpr double kRimMm = 0.25;   // radius of the disc's edge

std::string Shown(double value) {
  std::string text = std::to_string(value);
  text.erase(text.find_last_not_of('0') + 1);
  if (text.back() == '.') text.pop_back();
  return text;
}

Result<void> Check(const LinkModel& model, const SkinPush& push) {
  if (push.marker < 0 || push.marker >= model.markers.count()) {
    return Error{ErrorCode::kInvalidArgument, "no such marker; the model has " +
                                                  std::to_string(model.markers.paths) + " paths and " +
                                                  std::to_string(model.markers.rings()) + " rings"};
  }
  if (!std::isfinite(push.depth_mm) ||
      !(push.patch_diameter_mm >= 0 && push.patch_diameter_mm <= model.length_mm) || push.refinement < 1 ||
      push.refinement > 8) {
    return Error{ErrorCode::kInvalidArgument,
                 "the depth must be finite, the patch no larger than the skin, the refinement from 1 to 8"};
  }
  if (!(std::abs(push.pressure_mpa) <= kMaxPressureMpa)) {
    return Error{ErrorCode::kInvalidArgument, "the pressure must be between -20 and 20 kPa"};
  }
  if (!(push.specific_force_mps2.norm() <= kMaxSpecificForceMps2)) {
    return Error{ErrorCode::kInvalidArgument, "the specific force must be at most 100 m/s^2"};
  }
  const double z = model.markers.rings_z_mm[static_cast<size_t>(model.RingOf(push.marker))];
  const double room = model.PointAtDepth(0, z, model.thickness_mm).x() - model.tube_outer_radius_mm;
  if (push.depth_mm > room) {
    return Error{ErrorCode::kInvalidArgument, "a depth of " + Shown(push.depth_mm) +
                                                  " mm goes into the tube or beyond the axis; at most " +
                                                  Shown(room) + " mm is possible there"};
  }
  return {};
}

// The nodes under the disc; at least the pushed one, which comes first.
std::vector<int> NodesUnderDisc(const ShellMesh& mesh, int center, const Vec3& axis, double radius_mm) {
  std::vector<int> nodes = {center};
  const Vec3& c = mesh.mid_mm[static_cast<size_t>(center)];
  for (int node = 0; node < mesh.node_count(); ++node) {
    const Vec3 d = mesh.mid_mm[static_cast<size_t>(node)] - c;
    const bool same_side = mesh.normals[static_cast<size_t>(node)].dot(axis) > 0;
    if (node != center && !mesh.IsClamped(node) && same_side &&
        (d - d.dot(axis) * axis).norm() <= radius_mm) {
      nodes.push_back(node);
    }
  }
  return nodes;
}

// Of the nodes, by weight alone.
std::vector<Vec3> LinearSag(const LinkModel& model, const LinearShell& shell,
                            const Vec3& specific_force_mps2) {
  const Vec3 n_per_mm2 = model.MassPerArea() * specific_force_mps2;
  std::vector<NodalLoad> weights;
  for (int node = 0; node < shell.mesh().node_count(); ++node)
    weights.push_back({node, shell.mesh().areas_mm2[static_cast<size_t>(node)] * n_per_mm2});
  return shell.Solve(weights).translations_mm;
}

SkinPushResult PushLinear(const LinkModel& model, const SkinPush& push) {
  const LinearShell shell(model, push.refinement);
  const ShellMesh& mesh = shell.mesh();
  const int center = mesh.NodeOfMarker(model, push.marker);
  const Vec3 axis = mesh.normals[static_cast<size_t>(center)];
  const auto height = [&](int node, const std::vector<Vec3>& of) {
    return axis.dot(of[static_cast<size_t>(node)]);
  };
  const std::vector<Vec3> sag_mm = LinearSag(model, shell, push.specific_force_mps2);
  const auto inflated = [&](int node) {
    return push.pressure_mpa * height(node, shell.PerPressure().translations_mm) + height(node, sag_mm);
  };

  SkinPushResult result;
  result.inflation_mm = inflated(center);
  // The disc's face, as a height along the axis; a node above it must come down to it.
  const double face = height(center, mesh.mid_mm) - push.depth_mm;
  std::vector<int> nodes = NodesUnderDisc(mesh, center, axis, push.patch_diameter_mm / 2);
  std::erase_if(nodes, [&](int node) { return height(node, mesh.mid_mm) + inflated(node) <= face; });
  while (!nodes.empty()) {
    const auto n = static_cast<Eigen::Index>(nodes.size());
    Eigen::MatrixXd compliance(n, n);
    Eigen::VectorXd down(n);
    for (Eigen::Index j = 0; j < n; ++j) {
      const int node = nodes[static_cast<size_t>(j)];
      const NodalLoad load{node, -axis};
      const auto u = shell.Solve({&load, 1});
      for (Eigen::Index i = 0; i < n; ++i)
        compliance(i, j) = -height(nodes[static_cast<size_t>(i)], u.translations_mm);
      down[j] = height(node, mesh.mid_mm) + inflated(node) - face;
    }
    const Eigen::VectorXd force = compliance.ldlt().solve(down);
    Eigen::Index pulling = 0;
    if (force.minCoeff(&pulling) >= 0) {
      result.force_n = force.sum();
      result.nodes_in_contact = static_cast<int>(n);
      break;
    }
    nodes.erase(nodes.begin() + pulling);  // contact can't pull
  }
  return result;
}

Error NoEquilibrium(const char* where, const PressSummary& summary) {
  return {ErrorCode::kFailedPrecondition, std::string("no equilibrium found while ") + where + ": " +
                                              summary.Text() + "; try a finer mesh or a smaller load"};
}

Result<SkinPushResult> PushNonlinear(const LinkModel& model, const SkinPush& push) {
  PressedSkin skin(model, {.refinement = push.refinement});
  const PressSummary inflated = skin.Load({push.pressure_mpa, push.specific_force_mps2});
  if (!inflated.ok()) {
    const bool is_weightless = push.specific_force_mps2.isZero(0);
    return NoEquilibrium(is_weightless ? "inflating" : "applying pressure and weight", inflated);
  }
  const ShellMesh& mesh = skin.mesh();
  const auto center = static_cast<size_t>(mesh.NodeOfMarker(model, push.marker));
  const Vec3 axis = mesh.normals[center];
  SkinPushResult result;
  result.inflation_mm = (skin.state().mids_mm[center] - mesh.mid_mm[center]).dot(axis);
  // From just outside the inflated skin; a flat disc meets a doubly curved one at its highest point.
  double highest = result.inflation_mm;
  for (const int node : NodesUnderDisc(mesh, static_cast<int>(center), axis, push.patch_diameter_mm / 2)) {
    const auto i = static_cast<size_t>(node);
    highest = std::max(highest, axis.dot(skin.state().mids_mm[i] - mesh.mid_mm[center]));
  }
  const double start = highest + kStartMm;
  const double way = start + push.depth_mm;
  if (way > 0) {
    const Vec3 face = mesh.mid_mm[center] + (model.thickness_mm / 2 + start) * axis;
    const double radius = std::max(push.patch_diameter_mm / 2, kRimMm);
    skin.AddBody(RigidStamp{face, -axis, radius, kRimMm}, false);
    const Vec3 by = -way * axis;
    const PressSummary pushed = skin.Move({&by, 1});
    if (!pushed.ok()) return NoEquilibrium("pushing", pushed);
    const auto contact = skin.ContactOf(0);
    result.force_n = -contact.force_n.dot(axis);
    result.nodes_in_contact = contact.points;
    result.indentation_mm = contact.penetration_mm;
    result.solution = pushed.Text();
  }
  return result;
}

}  // namespace

Result<SkinPushResult> PushSkin(const LinkModel& model, const SkinPush& push) {
  if (auto good = Check(model, push); !good) return good.error();
  if (push.force_model == ForceModel::kLinear) return PushLinear(model, push);
  if (push.force_model == ForceModel::kNonlinear) return PushNonlinear(model, push);
  return Error{
      ErrorCode::kUnsupported,
      std::string("a push is solved with force model linear or nonlinear, not ") + Name(push.force_model)};
}

}  // namespace taclink
