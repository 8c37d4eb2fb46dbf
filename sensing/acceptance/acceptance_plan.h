#pragma once

#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "sensing/acceptance/acceptance.h"
#include "sensing/core/link_model.h"
#include "sensing/core/result.h"
#include "sensing/yaml/fields.h"

namespace taclink {

/// Trials of one kind, at one or more places.
struct AcceptanceSeries {
  std::string name;
  std::optional<double> force_n;       ///< none: nothing touches the skin, the pressure is compared
  std::optional<double> pressure_kpa;  ///< none: unchanged
  std::string attitude;
  double hold_s = 0;
  int repetitions = 1;
  int places = 1;                 ///< spread evenly over the skin, or over `path`
  int path = 0;                   ///< from 1: path of all places (weights on a lying link); 0: any path
  std::vector<int> markers = {};  ///< path, ring, path, ring, ... from 1; replaces `places`
  void Describe(FieldVisitor& visit);
};

/// The trials of an acceptance. Plan files begin with `taclink_acceptance: 1`.
struct AcceptancePlan {
  std::string name;
  std::string description;
  int seed = 1;  ///< of the random order of the trials
  std::vector<AcceptanceSeries> series;
  AcceptanceLimits limits;
  void Describe(FieldVisitor& visit);
};

/// Loads a shipped plan ("quick", "inflated", "full") or a YAML file. Errors: kNotFound (the message lists
/// the shipped plans), kInvalidArgument (file, line, what was expected).
Result<AcceptancePlan> LoadAcceptancePlan(const std::string& name_or_path);
Result<AcceptancePlan> ParseAcceptancePlan(const std::string& name, std::string_view text);
std::vector<std::string> ShippedPlanNames();
/// Empty: no such plan.
std::string_view ShippedPlanText(const std::string& name);

/// The trials of a plan for this link model. Trials with the same pressure and attitude form a group, since
/// both are slow to change. The order of the groups and of the trials in a group is random, so that drift
/// does not look like an effect of place, force or pressure; held loads are last in their group. Errors:
/// kInvalidArgument (a marker that the model does not have, too many trials).
Result<std::vector<AcceptanceTrial>> MakeTrials(const AcceptancePlan& plan, const LinkModel& model);

}  // namespace taclink
