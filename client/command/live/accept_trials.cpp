#include "client/command/live/accept_trials.h"

#include <fmt/format.h>

#include <cmath>
#include <cstdio>

#include "client/command/cli/units.h"
#include "sensing/core/printable.h"

namespace taclink::command {
namespace {

using Kind = TrialAnswer::Kind;

const Error kStopped{ErrorCode::kEndOfData,
                     "stopped: the readings so far are stored on the server; the same command resumes"};

bool HasSameCondition(const v1::AcceptanceTrial& a, const v1::AcceptanceTrial& b) {
  return a.has_pressure_pa() == b.has_pressure_pa() && a.pressure_pa() == b.pressure_pa() &&
         a.attitude() == b.attitude();
}

void PrintLoaded(const v1::AcceptanceTrial& trial) {
  const v1::TrialReading& reading = trial.loaded();
  if (2 * reading.usable_frames() < reading.frames() || reading.usable_frames() == 0) {
    fmt::print("  not measured: {} of {} frames have forces{}\n", reading.usable_frames(), reading.frames(),
               reading.reasons().empty() ? "" : ": " + Printable(reading.reasons(0).text()));
    return;
  }
  if (trial.kind() == v1::TRIAL_KIND_PRESSURE) {
    fmt::print("  the link's sensor says {:.3f} kPa\n", kKpaPerPascal * reading.pressure_pa());
    return;
  }
  const double reference_n = trial.reference().has_force_n() ? trial.reference().force_n() : trial.force_n();
  std::string line = reading.has_contact() ? fmt::format("  measured {:.3f} N", reading.force_n())
                                           : std::string("  nothing was felt there");
  if (reading.has_contact() && reference_n > 0)
    line += fmt::format(", {:+.1f} % off {:.3f} N", 100 * (reading.force_n() / reference_n - 1), reference_n);
  if (trial.loaded().held_size() > 1) {
    const auto& held = trial.loaded().held();
    line +=
        fmt::format(", {:+.1f} % within {:.0f} s",
                    100 * (held[held.size() - 1].force_n() / held[0].force_n() - 1), reading.duration_s());
  }
  if (reading.others_n() > 0.01) line += fmt::format("; {:.3f} N elsewhere", reading.others_n());
  fmt::print("{}\n", line);
}

/// One run through the open trials.
class Run {
 public:
  Run(client::Acceptances& calls, v1::Acceptance acceptance, TrialOperator& trial_operator)
      : calls_(calls), acceptance_(std::move(acceptance)), operator_(trial_operator) {}

  Result<v1::Acceptance> All() {
    while (acceptance_.next_trial() != 0) {
      const v1::AcceptanceTrial trial = Find(acceptance_.next_trial());
      const auto measured = One(trial);
      if (!measured) return measured.error();
      if (*measured) last_measured_ = trial.id();
    }
    return std::move(acceptance_);
  }

 private:
  const v1::AcceptanceTrial& Find(uint32_t id) const {
    for (const auto& trial : acceptance_.trials())
      if (trial.id() == id) return trial;
    return v1::AcceptanceTrial::default_instance();
  }

  // False: the trial was skipped, or another one comes first.
  Result<bool> One(const v1::AcceptanceTrial& trial) {
    fmt::print("{} of {}: ", trial.id(), acceptance_.trials_size());
    if (!condition_ || !HasSameCondition(*condition_, trial)) {
      condition_.reset();
      is_cleared_ = false;  // what touches while the pressure is set, or the link is turned, is not known
      if (auto going = GoesOn(operator_.SetCondition(trial), trial); !going || !*going) return going;
      condition_ = trial;
    }
    if (trial.kind() == v1::TRIAL_KIND_PRESSURE) {
      const auto cleared = operator_.Clear();
      if (auto going = GoesOn(cleared, trial); !going || !*going) return going;
      is_cleared_ = true;
      return Measured(trial, v1::TRIAL_PHASE_LOADED, cleared->reference);
    }
    if (!is_cleared_) {
      if (auto going = GoesOn(operator_.Clear(), trial); !going || !*going) return going;
      is_cleared_ = true;
      if (auto measured = Measured(trial, v1::TRIAL_PHASE_UNLOADED, {}); !measured) return measured;
    }
    const auto loaded = operator_.Load(trial);
    if (auto going = GoesOn(loaded, trial); !going || !*going) return going;
    is_cleared_ = false;
    if (auto measured = Measured(trial, v1::TRIAL_PHASE_LOADED, loaded->reference); !measured)
      return measured;
    if (auto going = GoesOn(operator_.Release(trial), trial); !going || !*going) return going;
    is_cleared_ = true;
    return Measured(trial, v1::TRIAL_PHASE_RELEASED, {});
  }

  // False: the trial is skipped, or the one before is done again.
  Result<bool> GoesOn(const Result<TrialAnswer>& answer, const v1::AcceptanceTrial& trial) {
    if (!answer) return answer.error();
    if (answer->kind == Kind::kStop) return kStopped;
    if (answer->kind == Kind::kReady) return true;
    if (answer->kind == Kind::kRepeat && last_measured_ == 0) {
      fmt::print("  there is no trial before this one to repeat\n");
      return false;
    }
    const bool repeats = answer->kind == Kind::kRepeat;
    v1::SkipTrialRequest request;
    request.set_link(acceptance_.link());
    request.set_trial(repeats ? last_measured_ : trial.id());
    request.set_reopen(repeats);
    auto skipped = calls_.Skip(request);
    if (!skipped) return skipped.error();
    acceptance_ = *std::move(skipped);
    fmt::print("  {}\n", repeats ? "the trial before is done again" : "skipped");
    return false;
  }

  // True.
  Result<bool> Measured(const v1::AcceptanceTrial& trial, v1::TrialPhase phase,
                        const v1::TrialReference& reference) {
    v1::MeasureTrialRequest request;
    request.set_link(acceptance_.link());
    request.set_trial(trial.id());
    request.set_phase(phase);
    *request.mutable_reference() = reference;
    if (phase == v1::TRIAL_PHASE_LOADED && trial.hold_s() > 0) {
      fmt::print("  measuring for {:.0f} s; the load must not be touched\n", trial.hold_s());
      std::fflush(stdout);
    }
    auto measured = calls_.Measure(request, phase == v1::TRIAL_PHASE_LOADED ? trial.hold_s() : 0);
    if (!measured) return measured.error();
    acceptance_ = *std::move(measured);
    const v1::AcceptanceTrial& now = Find(trial.id());
    if (phase == v1::TRIAL_PHASE_LOADED) PrintLoaded(now);
    if (phase == v1::TRIAL_PHASE_RELEASED && now.released().force_n() + now.released().others_n() > 0.01)
      fmt::print("  {:.3f} N left after the load\n", now.released().force_n() + now.released().others_n());
    std::fflush(stdout);
    return true;
  }

  client::Acceptances& calls_;
  v1::Acceptance acceptance_;
  TrialOperator& operator_;
  std::optional<v1::AcceptanceTrial>
      condition_;            // pressure and attitude of this one are there; none: not known
  bool is_cleared_ = false;  // nothing touches
  uint32_t last_measured_ = 0;
};

}  // namespace

Result<v1::Acceptance> MeasureTrials(client::Acceptances& calls, v1::Acceptance acceptance,
                                     TrialOperator& trial_operator) {
  return Run(calls, std::move(acceptance), trial_operator).All();
}

}  // namespace taclink::command
