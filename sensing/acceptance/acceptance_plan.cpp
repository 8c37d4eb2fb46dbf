#include "sensing/acceptance/acceptance_plan.h"

#include <algorithm>
#include <cmath>
#include <map>
#include <random>
#include <span>
#include <utility>

#include "sensing/core/embedded_file.h"
#include "sensing/core/read_file.h"
#include "sensing/core/units.h"
#include "sensing/yaml/yaml_reader.h"

namespace taclink {

std::span<const EmbeddedFile> EmbeddedPlans();

namespace {

constexpr const char* kVersionKey = "taclink_acceptance";
constexpr int kPlanVersion = 1;
constexpr size_t kMostTrials = 2000;
constexpr double kGolden = 0.6180339887498949;  // path step: successive places are far apart

struct MarkerPlace {
  int path = 0, ring = 0;  // from 1
};

void DescribeLimits(FieldVisitor& visit, AcceptanceLimits& limits) {
  constexpr Range kShare{0, 10};
  visit("force_floor_n", limits.force_floor_n, {0.001, 1000},
        "Errors are relative to the load, or to this where the load is weaker.");
  visit("force_error", limits.force_error, kShare,
        "95th percentile of the relative force error of single loads; 0 here and below: not limited.");
  visit("force_bias", limits.force_bias, kShare, "Magnitude of the mean relative force error.");
  visit("place_error_mm", limits.place_error_mm, {0, 1000}, "95th percentile of the error of places.");
  visit("repeatability", limits.repeatability, kShare, "Relative standard deviation of repeated loads.");
  visit("ghost_n", limits.ghost_n, {0, 100}, "Force that remains after a load, 95th percentile.");
  visit("creep", limits.creep, kShare, "Relative change of the force of a held load.");
  visit("pressure_slope", limits.pressure_slope, kShare, "Change of the relative force error per kPa.");
  visit("attitude_effect", limits.attitude_effect, kShare,
        "Difference of the mean relative force error between attitudes.");
  visit("balance", limits.balance, kShare,
        "95th percentile of the resultant of all contacts less the load, by the load.");
  visit("pressure_error", limits.pressure_error, kShare, "Relative error of the pressure sensor's gain.");
  visit("drift_mm_per_h", limits.drift_mm_per_h, {0, 1000}, "Drift of the baseline.");
}

std::vector<MarkerPlace> PlacesOf(const AcceptanceSeries& series, const LinkModel& model) {
  std::vector<MarkerPlace> places;
  for (size_t i = 0; i + 1 < series.markers.size(); i += 2)
    places.push_back({series.markers[i], series.markers[i + 1]});
  if (!places.empty() || !series.force_n) return places;
  const int rings = model.markers.rings(), paths = model.markers.paths;
  // Skips the outermost rings if possible: the clamp carries part of a load there.
  const int first = rings > 2 ? 2 : 1, last = rings > 2 ? rings - 1 : rings;
  for (int i = 0; i < series.places; ++i) {
    const double share = (i + 0.5) / series.places;
    const int ring = first + static_cast<int>(share * (last - first + 1));
    const int path =
        series.path > 0 ? series.path : 1 + static_cast<int>(std::fmod(i * kGolden, 1.0) * paths);
    places.push_back({path, std::min(ring, last)});
  }
  return places;
}

AcceptanceTrial TrialOf(const AcceptanceSeries& series, MarkerPlace place, int repetition) {
  AcceptanceTrial trial;
  trial.kind = !series.force_n     ? TrialKind::kPressure
               : series.hold_s > 0 ? TrialKind::kHold
                                   : TrialKind::kLoad;
  trial.path = place.path;
  trial.ring = place.ring;
  trial.force_n = series.force_n;
  if (series.pressure_kpa) trial.pressure_mpa = *series.pressure_kpa * kMpaPerKpa;
  trial.attitude = series.attitude;
  trial.hold_s = series.hold_s;
  trial.repetition = repetition;
  return trial;
}

}  // namespace

void AcceptanceSeries::Describe(FieldVisitor& visit) {
  visit(Required("name"), name, "Name of the series, unique within the plan.");
  visit("force_n", force_n, {0.005, 1000},
        "Load; not set: the pressure is compared, nothing touches the skin.");
  visit("pressure_kpa", pressure_kpa, {-20, 20}, "Gauge pressure inside the skin; not set: as it is.");
  visit("attitude", attitude, "Name of the link's attitude, for the person; empty: as it is.");
  visit("hold_s", hold_s, {0, 36000}, "How long each load stays; 0: as long as it takes to measure it.");
  visit("repetitions", repetitions, {1, 100}, "Of each place.");
  visit("places", places, {1, 1000}, "Places, spread evenly over the skin.");
  visit("path", path, {0, 256}, "All places are on this path, from 1; 0: on any.");
  visit("markers", markers, {1, 256}, "path, ring, path, ring, ... in place of `places`.");
  visit.Check(markers.size() % 2 == 0, "markers", "must be pairs of path and ring");
  visit.Check(force_n || pressure_kpa, "force_n", "must be set, or pressure_kpa", {"pressure_kpa"});
  visit.Check(force_n || hold_s == 0, "hold_s", "needs a load: force_n", {"force_n"});
}

void AcceptancePlan::Describe(FieldVisitor& visit) {
  int version = kPlanVersion;
  visit(Required(kVersionKey), version, {1, kPlanVersion}, "Version of this format.");
  visit(Required("name"), name, "Name of the plan, as the report has it.");
  visit("description", description, "What it is for, one line.");
  visit("seed", seed, {0, 1e9}, "Of the random order of the trials.");
  visit(Required("series"), series, AcceptanceSeries{}, "series", "Loads of one kind, or a pressure.");
  visit.Map("limits", "Largest errors with which a link passes.",
            [this](FieldVisitor& fields) { DescribeLimits(fields, limits); });
}

Result<AcceptancePlan> ParseAcceptancePlan(const std::string& name, std::string_view text) {
  auto file = YamlFile::Parse(name, text);
  if (!file) return file.error();
  AcceptancePlan plan;
  ReadFields(file->root(), "", [&](FieldVisitor& visit) { plan.Describe(visit); });
  if (const auto finished = file->Finish(); !finished) return finished.error();
  if (plan.series.empty())
    return Error{ErrorCode::kInvalidArgument, name + ": 'series' must have at least one entry"};
  return plan;
}

Result<AcceptancePlan> LoadAcceptancePlan(const std::string& name_or_path) {
  if (const auto text = ShippedPlanText(name_or_path); !text.empty())
    return ParseAcceptancePlan(name_or_path, text);
  const auto text = ReadFile(name_or_path);
  if (text) return ParseAcceptancePlan(name_or_path, *text);
  if (text.error().code != ErrorCode::kNotFound) return text.error();
  std::string names;
  for (const auto& name : ShippedPlanNames()) names += (names.empty() ? "" : ", ") + name;
  return Error{ErrorCode::kNotFound,
               "acceptance plan '" + name_or_path + "' is neither a file nor a shipped plan (" + names + ")"};
}

std::vector<std::string> ShippedPlanNames() {
  std::vector<std::string> names;
  for (const auto& file : EmbeddedPlans()) names.emplace_back(file.name.substr(0, file.name.rfind('.')));
  return names;
}

std::string_view ShippedPlanText(const std::string& name) {
  for (const auto& file : EmbeddedPlans())
    if (file.name == name + ".yaml") return file.content;
  return {};
}

Result<std::vector<AcceptanceTrial>> MakeTrials(const AcceptancePlan& plan, const LinkModel& model) {
  using Condition = std::pair<std::optional<double>, std::string>;  // pressure and attitude
  std::map<Condition, std::vector<AcceptanceTrial>> by_condition;
  size_t count = 0;
  for (const AcceptanceSeries& series : plan.series) {
    std::vector<MarkerPlace> places = PlacesOf(series, model);
    if (places.empty()) places.push_back({});
    for (const MarkerPlace& place : places) {
      if (place.path > model.markers.paths || place.ring > model.markers.rings()) {
        return Error{ErrorCode::kInvalidArgument,
                     "plan '" + plan.name + "', series '" + series.name + "': there is no marker (" +
                         std::to_string(place.path) + ", " + std::to_string(place.ring) + "); model '" +
                         model.name + "' has paths 1 to " + std::to_string(model.markers.paths) +
                         " and rings 1 to " + std::to_string(model.markers.rings())};
      }
      count += static_cast<size_t>(series.repetitions);
      if (count > kMostTrials) {
        return Error{ErrorCode::kInvalidArgument,
                     "plan '" + plan.name + "' has more than " + std::to_string(kMostTrials) + " trials"};
      }
      for (int i = 1; i <= series.repetitions; ++i) {
        AcceptanceTrial trial = TrialOf(series, place, i);
        by_condition[{trial.pressure_mpa, trial.attitude}].push_back(std::move(trial));
      }
    }
  }
  std::mt19937_64 random(static_cast<uint64_t>(plan.seed));
  // Not std::shuffle: its result differs between libraries, and a plan must have the same order everywhere.
  const auto shuffle = [&random](auto& items) {
    for (size_t i = items.size(); i > 1; --i) std::swap(items[i - 1], items[random() % i]);
  };
  std::vector<std::vector<AcceptanceTrial>> groups;
  for (auto& [condition, trials] : by_condition) groups.push_back(std::move(trials));
  shuffle(groups);
  std::vector<AcceptanceTrial> all;
  for (auto& group : groups) {
    shuffle(group);
    // Held loads last: their residual creep would disturb the short loads.
    std::ranges::stable_partition(group, [](const auto& trial) { return trial.kind != TrialKind::kHold; });
    for (AcceptanceTrial& trial : group) {
      trial.id = static_cast<uint32_t>(all.size() + 1);
      all.push_back(std::move(trial));
    }
  }
  return all;
}

const AcceptanceTrial* NextTrial(const AcceptanceRecord& record) {
  const auto next = std::ranges::find(record.trials, TrialState::kOpen, &AcceptanceTrial::state);
  return next == record.trials.end() ? nullptr : &*next;
}

}  // namespace taclink
