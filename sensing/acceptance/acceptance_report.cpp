#include "sensing/acceptance/acceptance_report.h"

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <map>
#include <numbers>
#include <set>

#include "sensing/acceptance/held_loads.h"
#include "sensing/acceptance/mounting_fit.h"
#include "sensing/acceptance/quantities.h"
#include "sensing/core/units.h"

namespace taclink {
namespace {

// Smaller effects are not reported, even if they are significant.
constexpr double kLeastScale = 0.05, kLeastGain = 0.02, kLeastOffsetKpa = 0.02, kLeastCreep = 0.03;
constexpr double kLeastSpanKpa = 0.2, kLeastSpanH = 0.02;  // smallest range for a slope
constexpr double kLeastTurnRad = 1.5 * std::numbers::pi / 180, kLeastShiftMm = 2;
constexpr double kLeastPhantomN = 0.03, kLeastReasonShare = 0.2;

/// Builds the report of one record, quantity by quantity.
class Analysis {
 public:
  explicit Analysis(const AcceptanceRecord& record) : record_(record), limits_(record.limits) {}

  AcceptanceReport Run() {
    report_.loads = LoadErrors(record_);
    Count();
    Forces();
    Percentile("place_error", "Place of contacts, 95 %", "mm", limits_.place_error_mm, &LoadError::place_mm,
               1);
    Repeatability();
    Percentile("ghost", "Force left after a load, 95 %", "N", limits_.ghost_n, &LoadError::ghost_n, 1);
    Percentile("balance", "Force balance: resultant less load, 95 %", "%", kPercent * limits_.balance,
               &LoadError::balance, kPercent);
    Creep();
    PressureEffect();
    AttitudeEffect();
    PressureSensor();
    Drift();
    Mounting();
    Reported();
    Conclude();
    return std::move(report_);
  }

 private:
  void Add(AcceptanceQuantity quantity) { report_.quantities.push_back(std::move(quantity)); }
  void Find(FindingId id, std::string text) { report_.findings.push_back({id, std::move(text)}); }

  void Count() {
    for (const AcceptanceTrial& trial : record_.trials) {
      report_.measured += trial.state == TrialState::kMeasured ? 1 : 0;
      report_.skipped += trial.state == TrialState::kSkipped ? 1 : 0;
      report_.open += trial.state == TrialState::kOpen ? 1 : 0;
      if (trial.state == TrialState::kMeasured && trial.loaded && !IsUsable(*trial.loaded))
        ++report_.withheld;
    }
  }

  void Percentile(const char* id, const char* label, const char* unit, double limit, ErrorOfLoad error,
                  double scale) {
    AcceptanceQuantity quantity = Describe(id, label, unit, limit);
    const auto values = Values(report_.loads, error, true);
    Set(quantity, GroupedPercentile(values, 0.95), static_cast<int>(values.size()), scale);
    Add(std::move(quantity));
  }

  void Forces() {
    const auto errors = Values(report_.loads, &LoadError::force_to_floor, false);
    AcceptanceQuantity bias =
        Describe("force_bias", "Force: mean error over places", "%", kPercent * limits_.force_bias);
    Estimate mean = GroupedMean(errors);
    // The uncertainty of the references is common to all loads: averaging does not reduce it.
    if (mean.half_width) mean.half_width = std::hypot(*mean.half_width, ReferenceWidth());
    Set(bias, mean, static_cast<int>(errors.size()), kPercent);
    Add(std::move(bias));
    Percentile("force_error", "Force: error of single loads, 95 %", "%", kPercent * limits_.force_error,
               &LoadError::force_to_floor, kPercent);
    // At the lowest pressure, where the wall's stiffness carries most of a load.
    std::optional<double> lowest_kpa;
    for (const LoadError& load : report_.loads)
      if (load.force && load.pressure_kpa)
        lowest_kpa = std::min(lowest_kpa.value_or(1e9), *load.pressure_kpa);
    std::vector<GroupedValue> slack;
    for (const LoadError& load : report_.loads)
      if (load.force && (!lowest_kpa || (load.pressure_kpa && *load.pressure_kpa < *lowest_kpa + 0.1)))
        slack.push_back({load.place, *load.force});
    const Estimate scale = GroupedMean(slack);
    if (!scale.excludes_zero() || std::abs(scale.value) < kLeastScale) return;
    Find(
        FindingId::kForceScale,
        "Forces" + (lowest_kpa ? Format(" at %.2f kPa", *lowest_kpa) : std::string()) + " read " +
            Interval(scale, kPercent, "%+.1f") +
            " % off: check the model's Young's modulus and thickness (`taclink calibrate material`), and the "
            "reference.");
  }

  // Half-width of the 95 % interval of the relative reference error, for the least certain reference.
  double ReferenceWidth() const {
    double most = 0;
    for (const AcceptanceTrial& trial : record_.trials) {
      if (trial.state != TrialState::kMeasured) continue;
      const auto force_n = ReferenceForce(trial);
      if (force_n && *force_n > 0)
        most = std::max(most, trial.reference.force_sigma_n / std::max(*force_n, limits_.force_floor_n));
    }
    constexpr double kNormal95 = 1.96;
    return kNormal95 * most;
  }

  void Repeatability() {
    std::vector<GroupedValue> repeated;
    for (const LoadError& load : report_.loads)
      if (load.force_to_floor) repeated.push_back({load.condition, *load.force_to_floor});
    AcceptanceQuantity quantity = Describe("repeatability", "Force: standard deviation of repeated loads",
                                           "%", kPercent * limits_.repeatability);
    const PercentileEstimate deviation = PooledDeviation(repeated);
    Set(quantity, deviation, static_cast<int>(repeated.size()), kPercent);
    Add(std::move(quantity));
  }

  void Creep() {
    const HeldLoads held = AnalyzeHolds(record_);
    AcceptanceQuantity quantity =
        Describe("creep", "Change of the force of a held load", "%", kPercent * limits_.creep);
    Set(quantity, held.change, held.change.samples, kPercent);
    Add(std::move(quantity));
    if (held.change.excludes_zero() && std::abs(held.change.value) >= kLeastCreep)
      Find(FindingId::kCreep,
           "A held load reads " + Interval(held.change, kPercent, "%+.1f") +
               " % different at its end: the skin creeps more than its model says; give the "
               "model a relaxation" +
               FittedRelaxation(record_) + ".");
  }

  void PressureEffect() {
    std::vector<GroupedValue> x;
    std::vector<double> y;
    for (const LoadError& load : report_.loads) {
      if (!load.force || !load.pressure_kpa) continue;
      x.push_back({load.place, *load.pressure_kpa});
      y.push_back(*load.force);
    }
    AcceptanceQuantity quantity = Describe("pressure_slope", "Change of the force error with pressure",
                                           "%/kPa", kPercent * limits_.pressure_slope);
    if (const auto line = FitLine(x, y, kLeastSpanKpa)) {
      Set(quantity, line->slope, static_cast<int>(x.size()), kPercent);
      if (line->slope.excludes_zero() && std::abs(line->slope.value) >= kLeastScale)
        Find(FindingId::kPressureEffect,
             "The force error changes by " + Interval(line->slope, kPercent, "%+.1f") +
                 " % per kPa: check the pressure sensor against a manometer, and the material's law.");
    }
    Add(std::move(quantity));
  }

  // Largest difference between two attitudes, over the places measured in both.
  void AttitudeEffect() {
    std::map<std::string, std::map<int, std::vector<double>>> errors;
    for (const LoadError& load : report_.loads)
      if (load.force && !load.attitude.empty()) errors[load.attitude][load.place].push_back(*load.force);
    AcceptanceQuantity quantity = Describe("attitude_effect", "Largest difference between attitudes", "%",
                                           kPercent * limits_.attitude_effect);
    Estimate worst;
    int loads = 0;
    std::string which;
    for (auto a = errors.begin(); a != errors.end(); ++a) {
      for (auto b = std::next(a); b != errors.end(); ++b) {
        std::vector<GroupedValue> differences;
        for (const auto& [place, of_a] : a->second) {
          const auto of_b = b->second.find(place);
          if (of_b == b->second.end()) continue;
          double mean_a = 0, mean_b = 0;
          for (const double e : of_a) mean_a += e / static_cast<double>(of_a.size());
          for (const double e : of_b->second) mean_b += e / static_cast<double>(of_b->second.size());
          differences.push_back({place, mean_b - mean_a});
          loads += static_cast<int>(of_a.size() + of_b->second.size());
        }
        const Estimate difference = GroupedMean(differences);
        if (difference.samples == 0 || std::abs(difference.value) < std::abs(worst.value)) continue;
        worst = difference;
        which = b->first + " less " + a->first;
      }
    }
    Set(quantity, worst, loads, kPercent);
    Add(std::move(quantity));
    if (worst.excludes_zero() && std::abs(worst.value) >= kLeastScale)
      Find(FindingId::kAttitudeEffect, "The force error depends on the attitude, " + which + ": " +
                                           Interval(worst, kPercent, "%+.1f") +
                                           " %: check the skin's density and the source of gravity.");
  }

  void PressureSensor() {
    std::vector<GroupedValue> manometer;
    std::vector<double> sensor;
    for (const AcceptanceTrial& trial : record_.trials) {
      if (trial.state != TrialState::kMeasured || !trial.reference.pressure_mpa) continue;
      if (!trial.loaded || !trial.loaded->pressure_mpa) continue;
      manometer.push_back({0, *trial.reference.pressure_mpa / kMpaPerKpa});
      sensor.push_back(*trial.loaded->pressure_mpa / kMpaPerKpa);
    }
    AcceptanceQuantity gain = Describe("pressure_gain", "Pressure sensor: error of the gain", "%",
                                       kPercent * limits_.pressure_error);
    if (auto line = FitLine(manometer, sensor, kLeastSpanKpa)) {
      line->slope.value -= 1;
      Set(gain, line->slope, static_cast<int>(sensor.size()), kPercent);
      const Estimate& zero_kpa = line->intercept;
      const bool is_off = line->slope.excludes_zero() && std::abs(line->slope.value) >= kLeastGain;
      if (is_off || (zero_kpa.excludes_zero() && std::abs(zero_kpa.value) >= kLeastOffsetKpa))
        Find(FindingId::kPressureSensor,
             "The pressure sensor reads " + Interval(line->slope, kPercent, "%+.1f") + " % off" +
                 Format(" and %+.3f kPa at zero: correct kpa_per_unit and offset_kpa.", zero_kpa.value));
    }
    Add(std::move(gain));
  }

  void Drift() {
    std::vector<GroupedValue> hours;
    std::vector<double> drift_mm;
    std::optional<int64_t> first_ns;
    std::map<int64_t, int> baselines;  // numbers by time: each tare or start restarts the drift
    for (const AcceptanceTrial& trial : record_.trials) {
      if (trial.state != TrialState::kMeasured || !trial.loaded) continue;
      const TrialReading& reading = trial.released ? *trial.released : *trial.loaded;
      if (!first_ns) first_ns = reading.utc_ns;
      const int count = static_cast<int>(baselines.size());
      const int baseline = baselines.emplace(reading.baseline_utc_ns, count).first->second;
      hours.push_back({baseline, 1e-9 / 3600 * static_cast<double>(reading.utc_ns - *first_ns)});
      drift_mm.push_back(reading.baseline_drift_mm);
    }
    AcceptanceQuantity quantity = Describe("drift", "Drift of the baseline", "mm/h", limits_.drift_mm_per_h);
    if (const auto line = FitLine(hours, drift_mm, kLeastSpanH))
      Set(quantity, line->slope, static_cast<int>(hours.size()));
    Add(std::move(quantity));
  }

  void Mounting() {
    std::vector<PlacePair> pairs;
    for (const AcceptanceTrial& trial : record_.trials) {
      if (trial.state != TrialState::kMeasured || !trial.loaded || !IsUsable(*trial.loaded)) continue;
      if (!trial.reference.place_mm || !trial.loaded->has_contact) continue;
      const auto load = std::ranges::find(report_.loads, trial.id, &LoadError::trial);
      const Vec3& reference_mm = *trial.reference.place_mm;
      pairs.push_back({load->place, reference_mm, AtRadiusOf(reference_mm, trial.loaded->center_mm)});
    }
    const char* const kAxes[] = {"x", "y", "z"};
    const auto fit = FitMounting(pairs);
    std::string off;
    for (size_t i = 0; i < 3; ++i) {
      AcceptanceQuantity turn = Describe(std::string("turn_") + kAxes[i],
                                         std::string("Contacts are turned about ") + kAxes[i], "deg", 0);
      AcceptanceQuantity shift = Describe(std::string("shift_") + kAxes[i],
                                          std::string("Contacts are shifted along ") + kAxes[i], "mm", 0);
      if (fit) {
        constexpr double kDegPerRad = 180 / std::numbers::pi;
        const Estimate &turned = fit->rotation_rad[i], &shifted = fit->shift_mm[i];
        if (turned.half_width) Set(turn, turned, static_cast<int>(pairs.size()), kDegPerRad);
        if (shifted.half_width) Set(shift, shifted, static_cast<int>(pairs.size()));
        if (turned.excludes_zero() && std::abs(turned.value) >= kLeastTurnRad)
          off += (off.empty() ? "" : ", ") + std::string("turned by ") +
                 Interval(turned, kDegPerRad, "%+.1f") + "° about " + kAxes[i];
        if (shifted.excludes_zero() && std::abs(shifted.value) >= kLeastShiftMm)
          off += (off.empty() ? "" : ", ") + std::string("shifted by ") + Interval(shifted, 1, "%+.1f") +
                 " mm along " + kAxes[i];
      }
      Add(std::move(turn));
      Add(std::move(shift));
    }
    if (!off.empty())
      Find(FindingId::kMounting, "Contacts lie off their references by a rigid motion (" + off +
                                     "): check the link's pose, and from where its paths are counted.");
  }

  // Reasons that the link reported, phantom forces, missed and withheld loads.
  void Reported() {
    std::map<ReasonId, std::pair<int, std::string>> reasons;
    int frames = 0;
    std::vector<GroupedValue> phantoms;
    const auto is_untouched = [](const AcceptanceTrial& trial, const std::optional<TrialReading>* reading) {
      return trial.kind == TrialKind::kPressure || reading == &trial.unloaded;
    };
    for (const AcceptanceTrial& trial : record_.trials) {
      if (trial.state != TrialState::kMeasured) continue;
      for (const auto* reading : {&trial.unloaded, &trial.loaded, &trial.released}) {
        if (!*reading) continue;
        frames += (*reading)->frames;
        for (const ReadingReason& reason : (*reading)->reasons) {
          auto& known = reasons[reason.id];
          known.first += reason.frames;
          if (known.second.empty()) known.second = reason.text;
        }
        if (reading != &trial.released && IsUsable(**reading))
          phantoms.push_back(
              {static_cast<int>(trial.id),
               (*reading)->others_n + (is_untouched(trial, reading) ? (*reading)->force_n : 0)});
      }
    }
    for (const auto& [id, reason] : reasons) {
      if (reason.first < kLeastReasonShare * frames) continue;
      const ReasonTraits& traits = TraitsOf(id);
      Find(traits.may_come_of_cameras ? FindingId::kCamera : FindingId::kWithheld,
           Format("In %.0f %% of the frames the link reports ", kPercent * reason.first / frames) +
               traits.name + ": " + reason.second);
    }
    const PercentileEstimate phantom = GroupedPercentile(phantoms, 0.95);
    if (phantom.value > kLeastPhantomN)
      Find(FindingId::kPhantom,
           Format("The link reports forces of %.2f N where nothing touches (95th percentile): "
                  "tare it, and check the cameras.",
                  phantom.value));
    for (const LoadError& load : report_.loads) report_.missed += load.force == -1 ? 1 : 0;
    if (report_.missed > 0)
      Find(FindingId::kMissed,
           Format("%d loads were not felt at their places: check the places, and that the loads exceed the "
                  "limit of detection there.",
                  report_.missed));
    if (report_.withheld > 0)
      Find(FindingId::kWithheld,
           Format("%d loads were not measured: the link withheld its forces.", report_.withheld));
  }

  // Whether the plan has trials for this quantity. A released phase, which tells ghosts, is optional.
  bool IsPlanned(const std::string& id) const {
    std::set<std::string> attitudes;
    std::set<double> pressures;
    bool has_loads = false, has_holds = false, repeats = false;
    for (const AcceptanceTrial& trial : record_.trials) {
      has_holds = has_holds || trial.kind == TrialKind::kHold;
      if (trial.kind == TrialKind::kPressure) continue;
      has_loads = true;
      repeats = repeats || trial.repetition > 1;
      if (!trial.attitude.empty()) attitudes.insert(trial.attitude);
      if (trial.pressure_mpa) pressures.insert(*trial.pressure_mpa / kMpaPerKpa);
    }
    if (id == "creep") return has_holds;
    if (id == "repeatability") return repeats;
    if (id == "attitude_effect") return attitudes.size() > 1;
    if (id == "pressure_slope")
      return pressures.size() > 1 && *pressures.rbegin() - *pressures.begin() >= kLeastSpanKpa;
    return has_loads && (id == "force_bias" || id == "force_error" || id == "place_error" || id == "balance");
  }

  void Conclude() {
    bool any = false, failed = report_.withheld + report_.missed > 0, undecided = report_.open > 0;
    for (const AcceptanceQuantity& quantity : report_.quantities) {
      const bool is_measured = quantity.verdict != Verdict::kNotMeasured;
      any = any || is_measured;
      failed = failed || quantity.verdict == Verdict::kFailed;
      undecided = undecided || quantity.verdict == Verdict::kUndecided ||
                  (!is_measured && quantity.limit > 0 && IsPlanned(quantity.id));
    }
    report_.verdict = !any        ? Verdict::kNotMeasured
                      : failed    ? Verdict::kFailed
                      : undecided ? Verdict::kUndecided
                                  : Verdict::kPassed;
  }

  const AcceptanceRecord& record_;
  const AcceptanceLimits& limits_;
  AcceptanceReport report_;
};

}  // namespace

const AcceptanceQuantity* AcceptanceReport::Quantity(const std::string& id) const {
  const auto found = std::ranges::find(quantities, id, &AcceptanceQuantity::id);
  return found == quantities.end() ? nullptr : &*found;
}

AcceptanceReport AnalyzeAcceptance(const AcceptanceRecord& record) {
  return Analysis(record).Run();
}

}  // namespace taclink
