#include "bench/force/accuracy_truth.h"

#include <algorithm>
#include <cstdio>

#include "bench/tools/thread_clock.h"
#include "sensing/shell/pressed_skin.h"

namespace taclink {
namespace {

constexpr double kClearMm = 0.1;  // of a body before it touches
constexpr double kBackMm = 0.25;  // a step towards the skin
constexpr double kDeepestMm = 10;
constexpr double kTouchedMm = 0.03;  // of a node from a body

std::vector<Vec3> Displacements(const LinkModel& model, const PressedSkin& skin) {
  std::vector<Vec3> u;
  for (int m = 0; m < model.markers.count(); ++m) u.push_back(skin.Marker(m) - model.RestMarker(m));
  return u;
}

// How deep a body may come without touching the inflated skin, from outside: inside of a much inflated one it
// would be free as well.
double FreeDepth(const LinkModel& model, const PressedSkin& skin, const PressBody& body) {
  const double unit = UnitsOf(model).length;
  double grown_mm = 0;
  for (size_t i = 0; i < skin.state().mids_mm.size(); ++i)
    grown_mm = std::max(grown_mm, (skin.state().mids_mm[i] - skin.mesh().mid_mm[i]).norm());
  const auto is_free = [&](double depth) {
    const RigidBody there = Grown(Moved(body.touching, body.Offset(depth, 0)), model.thickness_mm / 2);
    return std::all_of(skin.state().mids_mm.begin(), skin.state().mids_mm.end(),
                       [&](const Vec3& p) { return GapOf(there, p).distance_mm > kClearMm * unit; });
  };
  double depth = -grown_mm - 2 * kBackMm * unit;
  while (depth < kDeepestMm * unit && is_free(depth + kBackMm * unit)) depth += kBackMm * unit;
  return depth;
}

BodyContact ContactOf(const LinkModel& model, const PressedSkin& skin, int index, const RigidBody& body) {
  const RigidContact::Summary summary = skin.ContactOf(index);
  BodyContact contact{.force_n = summary.force_n, .center_mm = summary.center_mm, .touched_mm = {}};
  const RigidBody grown = Grown(body, model.thickness_mm / 2);
  for (int node = 0; node < skin.mesh().node_count(); ++node) {
    if (GapOf(grown, skin.state().mids_mm[static_cast<size_t>(node)]).distance_mm <
        kTouchedMm * UnitsOf(model).length)
      contact.touched_mm.push_back(skin.state().AtOffset(node, model.thickness_mm / 2));
  }
  return contact;
}

TrueStage Record(const LinkModel& model, const PressedSkin& skin, const PressPath& path,
                 const PressStage& stage) {
  TrueStage truth{
      .stage = stage, .displacements_mm = Displacements(model, skin), .contacts = {}, .baseline_mm = {}};
  for (size_t i = 0; i < path.bodies.size(); ++i) {
    const PressBody& body = path.bodies[i];
    truth.contacts.push_back(ContactOf(model, skin, static_cast<int>(i),
                                       Moved(body.touching, body.Offset(stage.depth_mm, stage.drag_mm))));
  }
  return truth;
}

std::string Where(const PressStage& stage) {
  char text[64];
  std::snprintf(text, sizeof text, "depth %g mm, drag %g mm", stage.depth_mm, stage.drag_mm);
  return text;
}

void FollowStages(const LinkModel& model, PressedSkin& skin, PathTruth& truth) {
  const PressPath& path = truth.path;
  std::vector<double> depths;
  for (const PressBody& body : path.bodies) {
    depths.push_back(std::min(FreeDepth(model, skin, body), path.stages.front().depth_mm));
    skin.AddBody(Moved(body.touching, body.Offset(depths.back(), 0)), body.sticks);
  }
  double drag = 0;
  for (const PressStage& stage : path.stages) {
    std::vector<Vec3> by;
    for (size_t i = 0; i < path.bodies.size(); ++i) {
      by.push_back(path.bodies[i].Offset(stage.depth_mm - depths[i], stage.drag_mm - drag));
      depths[i] = stage.depth_mm;
    }
    drag = stage.drag_mm;
    const PressSummary moved = skin.Move(by);
    if (!moved.ok() || !moved.stable) {
      truth.failure = "before " + Where(stage) + ": " + moved.Text() + (moved.ok() ? ", not stable" : "");
      return;
    }
    truth.stages.push_back(Record(model, skin, path, stage));
  }
}

// All stages have the same baseline: slack, with its weight.
void AddBaseline(const LinkModel& model, const PressedSkinOptions& options, PathTruth& truth) {
  if (truth.path.baseline_specific_force_mps2.isZero(0)) return;
  PressedSkin skin(model, options);
  const PressSummary weighed = skin.Load({0, truth.path.baseline_specific_force_mps2});
  if (!weighed.ok() || !weighed.stable) {
    truth.failure = "baseline: " + weighed.Text();
    truth.inflated = TrueStage();
    truth.stages.clear();
    return;
  }
  truth.inflated.baseline_mm = Displacements(model, skin);
  for (TrueStage& stage : truth.stages) stage.baseline_mm = truth.inflated.baseline_mm;
}

}  // namespace

double BodyContact::DistanceTo(const Vec3& point_mm) const {
  double distance = (point_mm - center_mm).norm();
  for (const Vec3& touched : touched_mm) distance = std::min(distance, (point_mm - touched).norm());
  return distance;
}

PathTruth SolvePath(const LinkModel& model, const PressPath& path, int refinement) {
  const int64_t start = ThreadCpuClock().MonotonicNs();
  PathTruth truth;
  truth.path = path;
  const double unit = UnitsOf(model).length;
  const PressedSkinOptions usual;
  const PressedSkinOptions options{.refinement = refinement,
                                   .step_mm = unit * usual.step_mm,
                                   .least_step_mm = unit * usual.least_step_mm,
                                   .spacing_mm = unit * usual.spacing_mm};
  PressedSkin skin(model, options);
  const PressSummary inflated = skin.Load({path.pressure_mpa, path.specific_force_mps2});
  if (!inflated.ok() || !inflated.stable) {
    truth.failure = "inflating: " + inflated.Text();
  } else {
    truth.inflated = Record(model, skin, PressPath{}, PressStage{});
    if (!path.stages.empty()) FollowStages(model, skin, truth);
    AddBaseline(model, options, truth);
  }
  truth.cpu_s = 1e-9 * static_cast<double>(ThreadCpuClock().MonotonicNs() - start);
  return truth;
}

}  // namespace taclink
