#include "sensing/shell/skin_response.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <string>
#include <utility>

#include "sensing/shell/skin_push.h"

namespace taclink {
namespace {

constexpr double kModulusMpa = 0.1;  // any: it cancels
constexpr size_t kWindow = 4;        // nodes of a cubic
// Steps of s, times thickness / radius; 0.4 kPa for the shipped cylinder, and half of it.
constexpr double kPushStep = 0.044;
constexpr size_t kGrowthPerPush = 2;
constexpr int kColumns = 64;  // elements around are enough for growth
constexpr size_t kMostNodes = 1000;
// Beyond, a skin has snapped to another branch.
constexpr double kMostGrowth = 0.5;  // of the radius
constexpr double kMostJump = 2;      // of a step's growth over that of the step before

// Lagrange's polynomials over the nodes 0, 1, 2, 3, and their derivatives.
struct Weights {
  std::array<double, kWindow> value{}, slope{};
};

Weights WeightsAt(double x) {
  Weights w;
  for (size_t i = 0; i < kWindow; ++i) {
    w.value[i] = 1;
    for (size_t j = 0; j < kWindow; ++j) {
      if (j == i) continue;
      const double from = x - static_cast<double>(j), span = static_cast<double>(i) - static_cast<double>(j);
      w.slope[i] = (w.slope[i] * from + w.value[i]) / span;
      w.value[i] *= from / span;
    }
  }
  return w;
}

// First of the nodes about s. They end with the next one: a skin may bear s and not much more.
size_t FirstNode(double s, double step) {
  return std::max<size_t>(static_cast<size_t>(s / step), 2) - 2;
}

Error NoSuchState(const std::string& why) {
  return {ErrorCode::kFailedPrecondition, why};
}

Result<void> CheckRange(double s, double step) {
  if (s >= 0 && s < kMostNodes * step) return {};
  return NoSuchState("the pressure must be 0 or more, and far below Young's modulus");
}

}  // namespace

SkinResponse::SkinResponse(const LinkModel& model, MaterialLaw law, int refinement,
                           std::function<void(int)> progress)
    : model_(model), refinement_(refinement), progress_(std::move(progress)) {
  model_.material.law = law;
  model_.material.youngs_modulus_mpa = kModulusMpa;
  if (law == MaterialLaw::kNeoHookean) model_.material.poisson_ratio = 0.5;
  const double radius = model_.PointAtDepth(0, model_.length_mm / 2, model_.thickness_mm / 2).x();
  push_step_ = kPushStep * model_.thickness_mm / radius;
  growth_step_ = push_step_ / kGrowthPerPush;
  growth_model_ = model_;
  growth_model_.markers.paths = (kColumns + refinement - 1) / refinement;
}

void SkinResponse::Solved() {
  ++solved_;
  if (progress_) progress_(solved_);
}

bool SkinResponse::GrownTo(size_t node) {
  while (growth_.size() <= node && Extend()) {
  }
  return growth_.size() > node;
}

bool SkinResponse::Extend() {
  if (!end_of_growth_.empty()) return false;
  if (!skin_)
    skin_ = std::make_unique<PressedSkin>(growth_model_, PressedSkinOptions{.refinement = refinement_});
  const size_t node = growth_.size();
  const double s = static_cast<double>(node) * growth_step_;
  const PressSummary summary = skin_->Inflate(s * kModulusMpa);
  Solved();
  std::vector<Vec2> rings;
  bool snapped = !summary.ok();
  for (int ring = 0; ring < model_.markers.rings(); ++ring) {
    const int marker = growth_model_.MarkerIndex(0, ring);
    const Vec3 at = skin_->Marker(marker), rest = growth_model_.RestMarker(marker);
    const double radius = rest.head<2>().norm(), grown = at.head<2>().dot(rest.head<2>()) / radius - radius;
    rings.emplace_back(grown, at.z() - rest.z());
    snapped = snapped || !(std::abs(grown) < kMostGrowth * radius);
    if (node < 2) continue;
    const auto i = static_cast<size_t>(ring);
    const double before = growth_[node - 1][i].x() - growth_[node - 2][i].x();
    snapped = snapped || (grown - growth_[node - 1][i].x() > kMostJump * before && before > 0);
  }
  if (snapped) {
    char text[96];
    std::snprintf(text, sizeof text, "the skin runs away at a pressure of about %.3g times Young's modulus",
                  s);
    end_of_growth_ = text;
    return false;
  }
  growth_.push_back(std::move(rings));
  return true;
}

Result<SkinResponse::Growth> SkinResponse::GrowthAt(double s) {
  if (auto good = CheckRange(s, growth_step_); !good) return good.error();
  const size_t first = FirstNode(s, growth_step_);
  if (!GrownTo(first + kWindow - 1)) return NoSuchState(end_of_growth_);
  const Weights w = WeightsAt(s / growth_step_ - static_cast<double>(first));
  const auto rings = static_cast<size_t>(model_.markers.rings());
  Growth growth{std::vector<Vec2>(rings, Vec2::Zero()), std::vector<Vec2>(rings, Vec2::Zero())};
  for (size_t i = 0; i < kWindow; ++i) {
    const std::vector<Vec2>& node = growth_[first + i];
    for (size_t ring = 0; ring < rings; ++ring) {
      growth.mm[ring] += w.value[i] * node[ring];
      growth.by_s[ring] += w.slope[i] / growth_step_ * node[ring];
    }
  }
  return growth;
}

const Result<double>& SkinResponse::PushNode(Nodes& nodes, const Disc& disc, size_t node) {
  if (nodes.size() <= node) nodes.resize(node + 1);
  std::optional<Result<double>>& known = nodes[node];
  if (known) return *known;
  if (!GrownTo(kGrowthPerPush * node)) return known.emplace(NoSuchState(end_of_growth_));
  const auto pushed = PushSkin(model_, {.marker = model_.MarkerIndex(0, disc.ring),
                                        .depth_mm = disc.depth_mm,
                                        .pressure_mpa = static_cast<double>(node) * push_step_ * kModulusMpa,
                                        .patch_diameter_mm = disc.diameter_mm,
                                        .refinement = refinement_});
  Solved();
  return known.emplace(pushed.ok() ? Result<double>(pushed->force_n / kModulusMpa) : pushed.error());
}

Result<SkinResponse::Push> SkinResponse::PushAt(const Disc& disc, double s) {
  if (auto good = CheckRange(s, push_step_); !good) return good.error();
  const size_t first = FirstNode(s, push_step_);
  const Weights w = WeightsAt(s / push_step_ - static_cast<double>(first));
  Push push;
  for (size_t i = 0; i < kWindow; ++i) {
    const Result<double>& node = PushNode(pushes_[disc], disc, first + i);
    if (!node) return node.error();
    push.mm2 += w.value[i] * *node;
    push.by_s += w.slope[i] / push_step_ * *node;
  }
  return push;
}

}  // namespace taclink
