#include "bench/command/bench_methods.h"

#include <algorithm>
#include <iterator>
#include <optional>

namespace taclink::command {

Result<std::vector<ForceMethod>> ForceMethods(const std::vector<std::string>& names,
                                              const std::vector<int>& refinements) {
  std::vector<std::optional<ForceModel>> known(std::begin(kForceModels), std::end(kForceModels));
  known.emplace_back();
  std::vector<ForceMethod> methods;
  for (const auto& model : known) {
    const std::string name = ForceMethod{model, 1}.name();
    if (!names.empty() && std::find(names.begin(), names.end(), name) == names.end()) continue;
    for (const int refinement : refinements) methods.push_back({model, refinement});
  }
  for (const std::string& name : names) {
    const bool there =
        std::any_of(methods.begin(), methods.end(), [&](const auto& m) { return m.name() == name; });
    if (!there)
      return Error{ErrorCode::kInvalidArgument, "no force model '" + name +
                                                    "'; there are literal, linear, pressurised, nonlinear "
                                                    "and auto"};
  }
  return methods;
}

}  // namespace taclink::command
