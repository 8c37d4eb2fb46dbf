#pragma once

#include <optional>

#include "server/config/regulator_options.h"

namespace taclink::server {

/// The air in a skin with a simulated pressure regulator, kPa gauge:
///
///     dp/dt = clamp((u - p) / tau, -slew, slew) - leak p
///
/// with the commanded pressure u, which is 0 while the valve is closed and the skin is vented. Solved in
/// closed form: one exponential while the valve is within its range, another while it is at a limit.
class RegulatedAir {
 public:
  explicit RegulatedAir(const SimulatedRegulatorOptions& options) : options_(options) {}

  /// None: vented.
  void Command(std::optional<double> kpa) { commanded_kpa_ = kpa.value_or(0); }
  /// Additional leak rate, kPa/s per kPa, such as that of a torn skin.
  void SetExtraLeak(double per_s) { extra_leak_per_s_ = per_s; }
  void Advance(double span_s);

  double kpa() const { return kpa_; }
  double kpa_per_s() const;  ///< dp/dt now
  double effort() const;     ///< share of the valve's range in use, 0 to 1

 private:
  double leak_per_s() const { return options_.leak_per_s + extra_leak_per_s_; }
  double Feed() const;

  SimulatedRegulatorOptions options_;
  double commanded_kpa_ = 0, extra_leak_per_s_ = 0, kpa_ = 0;
};

}  // namespace taclink::server
