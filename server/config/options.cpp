#include <cmath>

#include "server/config/config.h"

namespace taclink::server {
namespace {

constexpr double kMostN = 10'000;

Error Invalid(std::string message) {
  return {ErrorCode::kInvalidArgument, std::move(message)};
}

bool MayBeInflated(const LinkConfig& link) {
  if (!link.pressure) return false;
  const auto* constant = std::get_if<ConstantPressureConfig>(&link.pressure->source);
  return constant == nullptr || constant->kpa != 0;
}

// A simulated regulator inflates a simulated skin, a real one a real skin.
void CheckRegulator(FieldVisitor& visit, const LinkConfig& link) {
  const auto* regulator =
      link.pressure ? std::get_if<RegulatorPressureConfig>(&link.pressure->source) : nullptr;
  if (regulator == nullptr) return;
  const auto* simulated = std::get_if<SimulatedSourceConfig>(&link.source);
  visit.Check(regulator->device || simulated != nullptr, "pressure",
              "with source 'regulator' needs the 'device' of the regulator", {"source"});
  visit.Check(!regulator->device || simulated == nullptr, "pressure",
              "has a 'device', which cannot inflate a simulated skin: leave it out", {"source"});
  visit.Check(simulated == nullptr || simulated->pace == ScenePace::kClock, "pace",
              "must be 'clock' on a link with a simulated regulator, which runs by the clock");
}

void DescribePressure(FieldVisitor& visit, LinkConfig& link) {
  std::optional<double> constant_kpa;  // is written as the other key
  visit("pressure_kpa", constant_kpa, kPressureKpa, "Short for a constant `pressure`.");
  visit("pressure", link.pressure, "Gauge pressure inside the skin; not set: the simulation's, or 0.");
  visit.Check(!link.pressure || !std::holds_alternative<SimulatedPressureConfig>(link.pressure->source) ||
                  std::holds_alternative<SimulatedSourceConfig>(link.source),
              "pressure", "can only be 'simulated' where the link's source is", {"source"});
  CheckRegulator(visit, link);
  if (!constant_kpa) return;
  visit.Check(!link.pressure, "pressure_kpa", "is short for a constant 'pressure'; give one of them");
  link.pressure = PressureConfig{.source = ConstantPressureConfig{*constant_kpa}};
}

void DescribeDrift(FieldVisitor& visit, std::optional<DriftOptions>& drift) {
  bool follow = drift.has_value();
  DriftOptions value = drift.value_or(DriftOptions{});
  visit("follow", follow, "Whether the baseline follows.");
  visit("time_constant_s", value.time_constant_s, {0.1, 1e6}, "Time constant of the baseline.");
  visit("rate_limit_mm_s", value.rate_limit_mm_s, {1e-9, 10}, "Markers that move faster are not followed.");
  visit("limit_mm", value.limit_mm, {0.001, 100}, "Farther from the last tare the link is degraded.");
  visit("stop_n", value.stop_n, {0.001, 100}, "The baseline is held above this force.");
  visit("go_n", value.go_n, {0.0005, 100}, "The baseline follows again below this force.");
  visit("quiet_s", value.quiet_s, {0.1, 86400}, "Time below go_n before the baseline follows.");
  visit.Check(value.go_n < value.stop_n, "go_n", "must be below stop_n", {"stop_n"});
  drift = follow ? std::optional(value) : std::nullopt;
}

void DescribePose(FieldVisitor& visit, LinkConfig& link) {
  visit("frame", link.frame, "Link of the URDF that the pose is relative to; empty: the base.");
  visit(Required("position_mm"), link.position_mm, {-1e5, 1e5}, "Origin of the link's frame in that frame.");
  visit("rotation_deg", link.rotation_deg, {-360, 360}, "Roll, pitch, yaw about its fixed axes, as in URDF.");
}

}  // namespace

Result<void> CheckThresholds(const Thresholds& thresholds) {
  const auto good = [](double n) { return std::isfinite(n) && n >= 0 && n <= kMostN; };
  if (!good(thresholds.warning_n) || !good(thresholds.alarm_n) || !good(thresholds.hysteresis_n))
    return Invalid("warning_n, alarm_n and hysteresis_n must be numbers from 0 to 10000 N; 0: no such level");
  const double warning = thresholds.warning_n, alarm = thresholds.alarm_n;
  if (warning > 0 && alarm > 0 && alarm < warning) return Invalid("alarm_n must not be below warning_n");
  const double lowest = warning > 0 ? warning : alarm;
  if (lowest > 0 && thresholds.hysteresis_n >= lowest)
    return Invalid("hysteresis_n must be below the lower threshold, else a level is never left");
  return {};
}

Result<void> CheckRules(const LinkRules& rules, const MarkerGrid& grid) {
  if (auto good = CheckThresholds(rules.thresholds); !good) return good;
  for (const Region& region : rules.regions) {
    const std::string where = "region '" + region.name + "': ";
    if (auto good = CheckThresholds(region.thresholds); !good) return Invalid(where + good.error().message);
    if (region.first_ring > region.last_ring || region.last_ring >= grid.rings() || region.first_ring < 0)
      return Invalid(where + "rings must be two rising numbers from 1 to " + std::to_string(grid.rings()));
    if (region.first_path < 0 || region.last_path < 0 || region.first_path >= grid.paths ||
        region.last_path >= grid.paths)
      return Invalid(where + "paths must be two numbers from 1 to " + std::to_string(grid.paths));
  }
  return {};
}

void LinkConfig::Describe(FieldVisitor& visit) {
  visit(Required("name"), name, "Unique on the arm.", CheckName);
  visit.NameOrPath(Required("model"), model, "Name of a shipped link model, or path.");
  visit.Variant(Required("source"), source, {"v4l2", "files", "simulated"}, "Where the images come from.");
  visit.Path("calibration", calibration, "Calibration of the cameras; not set: from the first images.");
  DescribePressure(visit, *this);
  visit("gravity", gravity, "Source of the link's attitude; not set: by joint states, or it never moves.");
  Names models = {"auto"};
  for (const ForceModel one : kForceModels) models.emplace_back(Name(one));
  visit.Choice("force_model", force_model, models, kForceModels, "`auto`: the cheapest that is accurate.");
  visit("force_model_anyway", force_model_anyway, "Allow `linear` on an inflated skin, for comparison.");
  if (const auto good = CheckForceModel(*this); !good)
    visit.Fail("force_model", good.error().message, {"pressure", "pressure_kpa", "force_model_anyway"});
  visit("force_refinement", force_refinement, {0, 3}, "Elements per marker interval; 0: the model's best.");
  visit.Map("drift", "How the baseline follows a skin that creeps.",
            [this](FieldVisitor& fields) { DescribeDrift(fields, drift); });
  visit("thresholds", rules.thresholds, "Levels of the force of the link's strongest contact.");
  visit("regions", rules.regions, Region{}, "region", "Parts of the marker grid with their own levels.");
  visit.Map("pose", "Where the link is.", [this](FieldVisitor& fields) { DescribePose(fields, *this); });
  visit("realtime", realtime, "How the link's threads run; what is not set is the file's `realtime`.");
}

Result<void> CheckForceModel(const LinkConfig& link, bool is_inflated) {
  if (link.force_model != ForceModel::kLinear || link.force_model_anyway) return {};
  if (!is_inflated && !MayBeInflated(link)) return {};
  return Error{
      ErrorCode::kFailedPrecondition,
      "is 'linear', which does not hold on an inflated skin, and the link has a pressure: choose 'auto', "
      "or say 'force_model_anyway: true'"};
}

Rigid3 LinkConfig::FrameFromLink() const {
  const auto about = [this](int axis) {
    return Eigen::AngleAxisd(RadFromDeg(rotation_deg[static_cast<size_t>(axis)]), Vec3::Unit(axis));
  };
  return {(about(2) * about(1) * about(0)).toRotationMatrix(), Vec3(position_mm.data())};
}

}  // namespace taclink::server
