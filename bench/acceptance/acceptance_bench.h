#pragma once

#include <cstdint>
#include <functional>
#include <string>
#include <vector>

#include "bench/vision/vision_report.h"
#include "sensing/acceptance/acceptance_report.h"
#include "sensing/core/link_model.h"

namespace taclink {

/// What is wrong with a simulated link, beside what always is (noise, jitter, the estimator's own errors).
enum class LinkFlaw : uint8_t {
  kNone,
  kModulus,   ///< the model's Young's modulus is 10 % off
  kPressure,  ///< the pressure sensor's gain is 5 % off
  kMounting,  ///< the link is turned by 5 degrees against where the references have it
  kCamera,    ///< one camera moved by 0.3 mm since the calibration
  kCreep,     ///< the skin creeps by 8 % within 60 s, and the model does not know it
};
inline constexpr const char* kLinkFlawNames[] = {"none",     "modulus", "pressure",
                                                 "mounting", "camera",  "creep"};
inline constexpr int kLinkFlaws = 6;

/// A number of a report whose true value is known, because the flaw was put there.
struct AcceptanceClaim {
  std::string quantity;
  double truth = 0, value = 0, low = 0, high = 0;  ///< in the quantity's unit
  bool holds() const { return low <= truth && truth <= high; }
};

/// One simulated link that was accepted from images.
struct AcceptanceOutcome {
  uint64_t seed = 0;
  LinkFlaw flaw = LinkFlaw::kNone;
  bool is_negative = false;  ///< the flaw's sign
  AcceptanceRecord record;
  AcceptanceReport report;
  std::vector<AcceptanceClaim> claims;
  bool is_found = false;              ///< the flaw is among the findings
  std::vector<FindingId> false_ones;  ///< findings of what is not wrong
  double cpu_s = 0;
  std::string failure;  ///< why the skin could not be simulated; then nothing else is set
};

struct AcceptanceBenchOptions {
  int links = 100;
  int first = 0;  ///< seed of the first one
  int jobs = 1;
  std::function<void(const AcceptanceOutcome&)> done = {};  ///< one at a time; may be empty
};

/// Accepts simulated links from rendered images, link by link with other flaws, places and noise. The loads
/// are the simulation's true ones; where the flaw lies is known to the bench alone.
std::vector<AcceptanceOutcome> RunAcceptanceBench(const LinkModel& model,
                                                  const AcceptanceBenchOptions& options);

/// A row for each flaw: found, false findings, intervals that hold the truth.
ReportTable AcceptanceTable(const std::vector<AcceptanceOutcome>& outcomes);

}  // namespace taclink
