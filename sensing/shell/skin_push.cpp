#include "sensing/shell/skin_push.h"

#include <Eigen/Cholesky>
#include <algorithm>
#include <array>
#include <cmath>
#include <string>
#include <utility>
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

Result<void> CheckLoads(const KnownLoads& loads, int refinement) {
  if (refinement < 1 || refinement > 8)
    return Error{ErrorCode::kInvalidArgument, "the refinement must be from 1 to 8"};
  if (!(std::abs(loads.pressure_mpa) <= kMaxPressureMpa))
    return Error{ErrorCode::kInvalidArgument, "the pressure must be between -20 and 20 kPa"};
  if (!(loads.specific_force_mps2.norm() <= kMaxSpecificForceMps2))
    return Error{ErrorCode::kInvalidArgument, "the specific force must be at most 100 m/s^2"};
  return {};
}

Result<void> CheckPlace(const LinkModel& model, int marker, double depth_mm, double patch_diameter_mm) {
  if (marker < 0 || marker >= model.markers.count()) {
    return Error{ErrorCode::kInvalidArgument, "no such marker; the model has " +
                                                  std::to_string(model.markers.paths) + " paths and " +
                                                  std::to_string(model.markers.rings()) + " rings"};
  }
  if (!std::isfinite(depth_mm) || !(patch_diameter_mm >= 0 && patch_diameter_mm <= model.length_mm)) {
    return Error{ErrorCode::kInvalidArgument,
                 "the depth must be finite, and the patch no larger than the skin"};
  }
  const double room = RoomBehindMm(model, marker);
  if (depth_mm > room) {
    return Error{ErrorCode::kInvalidArgument, "a depth of " + Shown(depth_mm) +
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

constexpr double kOnsetBegin = 0.1, kOnsetEnd = 0.2;  // of the thickness; see SkinStiffness

}  // namespace

double RoomBehindMm(const LinkModel& model, int marker) {
  const double z = model.markers.rings_z_mm[static_cast<size_t>(model.RingOf(marker))];
  return model.PointAtDepth(0, z, model.thickness_mm).x() - model.tube_outer_radius_mm;
}

LoadedSkin::LoadedSkin(const LinkModel& model, std::unique_ptr<PressedSkin> skin)
    : model_(model), skin_(std::move(skin)), untouched_(skin_->state()) {}
LoadedSkin::LoadedSkin(LoadedSkin&&) noexcept = default;
LoadedSkin& LoadedSkin::operator=(LoadedSkin&&) noexcept = default;
LoadedSkin::~LoadedSkin() = default;

Result<LoadedSkin> LoadedSkin::Make(const LinkModel& model, const KnownLoads& loads,
                                    const PressedSkinOptions& options) {
  if (auto good = CheckLoads(loads, options.refinement); !good) return good.error();
  auto skin = std::make_unique<PressedSkin>(model, options);
  const PressSummary inflated = skin->Load(loads);
  if (!inflated.ok()) {
    const bool is_weightless = loads.specific_force_mps2.isZero(0);
    return NoEquilibrium(is_weightless ? "inflating" : "applying pressure and weight", inflated);
  }
  return LoadedSkin(model, std::move(skin));
}

double LoadedSkin::InflationMm(int marker) const {
  const ShellMesh& mesh = skin_->mesh();
  const auto center = static_cast<size_t>(mesh.NodeOfMarker(model_, marker));
  return (untouched_.mids_mm[center] - mesh.mid_mm[center]).dot(mesh.normals[center]);
}

Result<std::vector<SkinPushResult>> LoadedSkin::Push(int marker, std::span<const double> depths_mm,
                                                     double patch_diameter_mm) {
  PushedAsFar pushed = PushAsFar(marker, depths_mm, patch_diameter_mm);
  if (!pushed.end) return pushed.end.error();
  return std::move(pushed.results);
}

LoadedSkin::PushedAsFar LoadedSkin::PushAsFar(int marker, std::span<const double> depths_mm,
                                              double patch_diameter_mm) {
  for (const double depth_mm : depths_mm) {
    if (auto good = CheckPlace(model_, marker, depth_mm, patch_diameter_mm); !good) return {{}, good};
  }
  skin_->RemoveBodies(untouched_);
  const ShellMesh& mesh = skin_->mesh();
  const auto center = static_cast<size_t>(mesh.NodeOfMarker(model_, marker));
  const Vec3 axis = mesh.normals[center];
  const double inflation_mm = InflationMm(marker);
  // From just outside the inflated skin; a flat disc meets a doubly curved one at its highest point.
  double highest = inflation_mm;
  for (const int node : NodesUnderDisc(mesh, static_cast<int>(center), axis, patch_diameter_mm / 2)) {
    const auto i = static_cast<size_t>(node);
    highest = std::max(highest, axis.dot(untouched_.mids_mm[i] - mesh.mid_mm[center]));
  }
  double height = highest + kStartMm;
  const double radius = std::max(patch_diameter_mm / 2, kRimMm);
  const Vec3 face = mesh.mid_mm[center] + (model_.thickness_mm / 2 + height) * axis;
  skin_->AddBody(RigidStamp{face, -axis, radius, kRimMm}, false);
  PushedAsFar all;
  for (const double depth_mm : depths_mm) {
    SkinPushResult result;
    result.inflation_mm = inflation_mm;
    if (height + depth_mm > 0) {  // else it does not come as far as the skin
      const Vec3 by = -(height + depth_mm) * axis;
      const PressSummary pushed = skin_->Move({&by, 1});
      if (!pushed.ok()) {
        all.end = NoEquilibrium("pushing", pushed);
        break;
      }
      height = -depth_mm;
      const auto contact = skin_->ContactOf(0);
      result.force_n = -contact.force_n.dot(axis);
      result.nodes_in_contact = contact.points;
      result.indentation_mm = contact.penetration_mm;
      result.solution = pushed.Text();
    }
    all.results.push_back(std::move(result));
  }
  return all;
}

Result<SkinStiffness> LoadedSkin::Stiffness(int marker, double indentation_mm, double patch_diameter_mm) {
  if (auto good = CheckPlace(model_, marker, 0, patch_diameter_mm); !good) return good.error();
  if (!(indentation_mm > 0)) return Error{ErrorCode::kInvalidArgument, "the indentation must be positive"};
  const double inflation_mm = InflationMm(marker);
  const double begin_mm = kOnsetBegin * model_.thickness_mm, end_mm = kOnsetEnd * model_.thickness_mm;
  std::array<double, 3> depths_mm = {begin_mm, end_mm, indentation_mm};
  std::ranges::sort(depths_mm);
  std::array<double, 3> from_uninflated_mm = depths_mm;
  for (double& depth_mm : from_uninflated_mm) depth_mm -= inflation_mm;
  const auto pushed = Push(marker, from_uninflated_mm, patch_diameter_mm);
  if (!pushed) return pushed.error();
  const auto force_at = [&](double depth_mm) {
    const auto found = std::ranges::find(depths_mm, depth_mm);
    return (*pushed)[static_cast<size_t>(found - depths_mm.begin())].force_n;
  };
  const double force_n = force_at(indentation_mm);
  return SkinStiffness{.inflation_mm = inflation_mm,
                       .force_n = force_n,
                       .secant_n_per_mm = force_n / indentation_mm,
                       .onset_n_per_mm = (force_at(end_mm) - force_at(begin_mm)) / (end_mm - begin_mm)};
}

Result<SkinPushResult> PushSkin(const LinkModel& model, const SkinPush& push) {
  const KnownLoads loads{push.pressure_mpa, push.specific_force_mps2};
  if (auto good = CheckPlace(model, push.marker, push.depth_mm, push.patch_diameter_mm); !good)
    return good.error();
  if (auto good = CheckLoads(loads, push.refinement); !good) return good.error();
  if (push.force_model == ForceModel::kLinear) return PushLinear(model, push);
  if (push.force_model != ForceModel::kNonlinear) {
    return Error{
        ErrorCode::kUnsupported,
        std::string("a push is solved with force model linear or nonlinear, not ") + Name(push.force_model)};
  }
  auto skin = LoadedSkin::Make(model, loads, {.refinement = push.refinement});
  if (!skin) return skin.error();
  const auto pushed = skin->Push(push.marker, {&push.depth_mm, 1}, push.patch_diameter_mm);
  if (!pushed) return pushed.error();
  return pushed->front();
}

}  // namespace taclink
