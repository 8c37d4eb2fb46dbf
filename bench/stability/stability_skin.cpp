#include <algorithm>
#include <cmath>
#include <cstdio>
#include <limits>
#include <memory>

#include "bench/stability/stability_cases.h"
#include "bench/stability/stability_measure.h"
#include "sensing/shell/body_force.h"
#include "sensing/shell/linear_shell.h"
#include "sensing/shell/pressed_skin.h"

namespace taclink {
namespace {

constexpr double kSphereMm = 10, kClearMm = 0.1;
constexpr int kWeighings = 32, kInflations = 32, kPresses = 8;  // steps of each path, for the work
constexpr double kMostResidual = 2e-7, kMostEnergyError = 0.01, kMostReciprocity = 1e-4,
                 kMostScalingMm = 1e-4, kMostLinearError = 0.01, kMostBackward = 1e-12;

struct Path {
  explicit Path(const SkinCase& c, int refinement) : skin(c.model, {.refinement = refinement}) {}

  PressedSkin skin;
  std::string refused;  // empty: arrived
  bool stable = true;
  double work_nmm = 0, stored_nmm = 0;
  RigidBody body;
};

// All that acts at the end of a path, made anew.
struct EndLoads {
  EndLoads(const SkinCase& c, const Path& path)
      : pressure(path.skin.pressure_mpa()),
        corner_areas_mm2(CornerAreas(path.skin.shell().surface())),
        weight(corner_areas_mm2, c.model.MassPerArea() * c.specific_force_mps2) {
    const RigidContactOptions options{
        .spacing_mm = PressedSkinOptions{}.spacing_mm,
        .stiffness_n_mm3 =
            PressedSkinOptions{}.stiffness * c.model.material.youngs_modulus_mpa / c.model.thickness_mm};
    tube = std::make_unique<RigidContact>(path.skin.shell(), options);
    tube->SetBody(RigidBar{Vec3::Zero(), Vec3::UnitZ(), c.model.tube_outer_radius_mm});
    loads = {&pressure, tube.get()};
    if (!c.specific_force_mps2.isZero(0)) loads.push_back(&weight);
    if (c.depth_mm <= 0) return;
    body = std::make_unique<RigidContact>(path.skin.shell(), options);
    body->SetBody(path.body);
    loads.push_back(body.get());
  }

  FollowerPressure pressure;
  std::vector<Eigen::Vector4d> corner_areas_mm2;  // weight refers to them
  BodyForce weight;
  std::unique_ptr<RigidContact> tube, body;
  std::vector<const ElementLoad*> loads;
};

void Note(Path& path, const PressSummary& summary, const char* where) {
  path.stable = summary.stable;
  if (!summary.ok() || summary.snaps > 0) path.refused = std::string(where) + ": " + summary.Text();
}

double StoredOf(const PressedSkin& skin) {
  return skin.shell().Energy(skin.state(), {});
}

double VolumeOf(const PressedSkin& skin) {
  const FollowerPressure unit(1);
  const ElementLoad* const load[] = {&unit};
  return StoredOf(skin) - skin.shell().Energy(skin.state(), load);
}

// Of the whole weight, N mm: the work that it does between two states is the difference.
double FallOf(const SkinCase& c, const PressedSkin& skin) {
  if (c.specific_force_mps2.isZero(0)) return 0;
  const auto corner_areas_mm2 = CornerAreas(skin.shell().surface());
  const BodyForce weight(corner_areas_mm2, c.model.MassPerArea() * c.specific_force_mps2);
  const ElementLoad* const load[] = {&weight};
  return StoredOf(skin) - skin.shell().Energy(skin.state(), load);
}

// As it grows, the weight's work is as that of a growing pressure below.
void Weigh(const SkinCase& c, Path& path) {
  std::vector<double> falls = {FallOf(c, path.skin)};
  const double step = 1.0 / kWeighings;
  for (int i = 1; i <= kWeighings && path.refused.empty(); ++i) {
    const double share = i == kWeighings ? 1 : i * step;
    Note(path, path.skin.Load({0, share * c.specific_force_mps2}), "weighing");
    falls.push_back(FallOf(c, path.skin));
  }
  if (path.refused.empty()) path.work_nmm = falls.back() - Simpson(falls, step);
}

// Work of the pressure is the integral of p by V = p V at the end less that of V by p.
void Inflate(const SkinCase& c, Path& path) {
  const double fall = FallOf(c, path.skin);
  std::vector<double> volumes = {VolumeOf(path.skin)};
  const double step = c.pressure_mpa / kInflations;
  for (int i = 1; i <= kInflations && path.refused.empty(); ++i) {
    Note(path, path.skin.Inflate(i == kInflations ? c.pressure_mpa : i * step), "inflating");
    volumes.push_back(VolumeOf(path.skin));
  }
  if (!path.refused.empty()) return;
  path.work_nmm += c.pressure_mpa * volumes.back() - Simpson(volumes, step);
  path.work_nmm += FallOf(c, path.skin) - fall;
}

double EnergyWithLoads(const SkinCase& c, const Path& path) {
  return path.skin.shell().Energy(path.skin.state(), EndLoads(c, path).loads);
}

// At constant pressure and weight the body's work is the change of the energy with all loads.
void Press(const SkinCase& c, Path& path) {
  const double z = c.model.length_mm / 2;
  const Vec3 surface = c.model.PointAtDepth(0, z, 0), out = c.model.OutwardNormal(0, z);
  double highest = 0;
  for (const Vec3& p : path.skin.state().mids_mm)
    highest = std::max(highest, p.head<2>().norm() + c.model.thickness_mm / 2 - surface.x());
  const double start = highest + kClearMm;
  path.body = RigidSphere{surface + (kSphereMm + start) * out, kSphereMm};
  path.skin.AddBody(path.body, false);
  const double before = EnergyWithLoads(c, path), work_before = path.work_nmm;
  const Vec3 by = -(start + c.depth_mm) / kPresses * out;
  std::vector<double> power = {0};
  for (int i = 1; i <= kPresses && path.refused.empty(); ++i) {
    Note(path, path.skin.Move({&by, 1}), "pressing");
    if (!path.refused.empty()) break;
    path.body = Moved(path.body, by);
    power.push_back(path.skin.ContactOf(0).force_n.dot(by));
  }
  if (!path.refused.empty()) return;
  path.work_nmm = work_before + Simpson(power, 1);
  path.stored_nmm += EnergyWithLoads(c, path) - before;
}

std::unique_ptr<const Path> Follow(const SkinCase& c, int refinement) {
  auto owned = std::make_unique<Path>(c, refinement);
  Path& path = *owned;
  const double rest = StoredOf(path.skin);
  if (!c.specific_force_mps2.isZero(0)) Weigh(c, path);
  if (path.refused.empty() && c.pressure_mpa != 0) Inflate(c, path);
  path.stored_nmm = StoredOf(path.skin) - rest;
  if (path.refused.empty() && c.depth_mm > 0) Press(c, path);
  return owned;
}

struct Checks {
  std::string passed, failed;

  void Check(const char* what, double value, double most) {
    char text[96];
    std::snprintf(text, sizeof text, "%s %.1e", what, value);
    std::string& to = value <= most ? passed : failed;
    to += (to.empty() ? "" : ", ") + std::string(text);
  }
};

double LargestDistance(const ShellState& a, const ShellState& b) {
  double distance = 0;
  for (size_t i = 0; i < a.mids_mm.size(); ++i)
    distance = std::max(distance, (a.mids_mm[i] - b.mids_mm[i]).norm());
  return distance;
}

// The same skin of another modulus, all loads scaled, ends in the same shape.
void CheckScaling(const SkinCase& c, const Path& path, int refinement, Checks& checks) {
  SkinCase reference = c;
  const double share = c.reference_modulus_mpa / c.model.material.youngs_modulus_mpa;
  reference.model.material.youngs_modulus_mpa = c.reference_modulus_mpa;
  reference.pressure_mpa *= share;
  reference.specific_force_mps2 *= share;
  const auto other = Follow(reference, refinement);
  checks.Check("shape against that of E = 0.1, mm:",
               other->refused.empty() ? LargestDistance(path.skin.state(), other->skin.state()) : kNan,
               kMostScalingMm);
}

// Under a small pressure it does as the linear shell, which is another element.
void CheckSmallPressure(const SkinCase& c, int refinement, Checks& checks) {
  const double small = 1e-4 * c.model.material.youngs_modulus_mpa * c.model.thickness_mm / 40;
  PressedSkin skin(c.model, {.refinement = refinement});
  const bool ok = skin.Inflate(small).ok();
  const LinearShell linear(c.model, refinement);
  double difference = 0, largest = 0;
  for (int node = 0; node < skin.mesh().node_count(); ++node) {
    const auto i = static_cast<size_t>(node);
    const Vec3 u = small * linear.PerPressure().translations_mm[i];
    difference = std::max(difference, (skin.state().mids_mm[i] - skin.mesh().mid_mm[i] - u).norm());
    largest = std::max(largest, u.norm());
  }
  checks.Check("against the linear shell", ok ? difference / largest : kNan, kMostLinearError);
}

void CheckEnd(const SkinCase& c, const Path& path, Checks& checks, StabilityRow& row) {
  const EndLoads end(c, path);
  const NonlinearShell& shell = path.skin.shell();
  checks.Check("residual / (E t^2)", ResidualOf(shell, end.loads, path.skin.state()), kMostResidual);
  const TangentNumbers tangent = MeasureTangent(shell, end.loads, path.skin.state());
  if (!tangent.definite) {
    checks.failed += "tangent not positive definite";
    return;
  }
  row.condition = tangent.condition;
  row.backward_error = tangent.backward_error;
  row.float_error = tangent.float_error;
  checks.Check("backward error", row.backward_error, kMostBackward);
  const ShellMesh& mesh = path.skin.mesh();
  const int a = shell.Dof(mesh.Node(mesh.columns / 4, mesh.rows / 2), 1);
  const int b = shell.Dof(mesh.Node(mesh.columns / 4 + 2, mesh.rows / 2 + 2), 0);
  row.reciprocity = Reciprocity(shell, end.loads, path.skin.state(), a, b);
  checks.Check("reciprocity", row.reciprocity, kMostReciprocity);
  row.energy_error = std::abs(path.work_nmm - path.stored_nmm) /
                     std::max(std::abs(path.work_nmm), std::abs(path.stored_nmm));
  checks.Check("energy", row.energy_error, kMostEnergyError);
  const double touch = path.skin.TubeContact().force_n.norm();
  if (touch > 0) {
    const double in = path.skin.TubeContact().penetration_mm / c.model.thickness_mm;
    checks.Check("in the tube / t", in, 0.05);
  }
}

}  // namespace

StabilityRow RunSkinCase(const SkinCase& skin_case, int refinement) {
  StabilityRow row{.name = skin_case.name,
                   .ending = Ending::kRefused,
                   .reason = {},
                   .condition = kNan,
                   .backward_error = kNan,
                   .float_error = kNan,
                   .energy_error = kNan,
                   .reciprocity = kNan};
  const auto followed = Follow(skin_case, refinement);
  const Path& path = *followed;
  if (!path.refused.empty() || !path.stable) {
    row.reason = path.refused.empty() ? "it says: not stable" : path.refused;
    return row;
  }
  Checks checks;
  CheckEnd(skin_case, path, checks, row);
  if (skin_case.reference_modulus_mpa > 0) {
    CheckScaling(skin_case, path, refinement, checks);
  } else {
    CheckSmallPressure(skin_case, refinement, checks);
  }
  row.ending = checks.failed.empty() ? Ending::kRight : Ending::kWrong;
  row.reason = checks.failed.empty() ? checks.passed : "failed: " + checks.failed;
  return row;
}

}  // namespace taclink
