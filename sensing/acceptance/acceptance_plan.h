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

/// Loads of one kind, at several places.
struct AcceptanceSeries {
  std::string name;
  std::optional<double> force_n;       ///< none: nothing touches the skin, its pressure is compared
  std::optional<double> pressure_kpa;  ///< none: as it is
  std::string attitude;
  double hold_s = 0;
  int repetitions = 1;
  int places = 1;                 ///< spread evenly over the skin, or over `path`
  int path = 0;                   ///< from 1: all places are on it (weights on a link that lies); 0: on any
  std::vector<int> markers = {};  ///< path, ring, path, ring, ... from 1, in place of `places`
  void Describe(FieldVisitor& visit);
};

/// What an acceptance consists of. A file of it begins with `taclink_acceptance: 1`.
struct AcceptancePlan {
  std::string name;
  std::string description;
  int seed = 1;  ///< of the order of the trials
  std::vector<AcceptanceSeries> series;
  AcceptanceLimits limits;
  void Describe(FieldVisitor& visit);
};

/// A shipped plan ("quick", "full") or a YAML file. Errors: kNotFound (names the shipped ones),
/// kInvalidArgument (file, line, what was expected).
Result<AcceptancePlan> LoadAcceptancePlan(const std::string& name_or_path);
Result<AcceptancePlan> ParseAcceptancePlan(const std::string& name, std::string_view text);
std::vector<std::string> ShippedPlanNames();
/// Empty: there is no such plan.
std::string_view ShippedPlanText(const std::string& name);

/// The trials of a plan on a link of this model. Trials with the same pressure and attitude follow each
/// other, since those are slow to change; the order of these groups and of the trials within one is random,
/// so that drift does not look like an effect of place, force or pressure. Errors: kInvalidArgument (a marker
/// that the model does not have).
Result<std::vector<AcceptanceTrial>> MakeTrials(const AcceptancePlan& plan, const LinkModel& model);

}  // namespace taclink
