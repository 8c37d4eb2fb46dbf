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
      if (auto measured = One(trial); !measured) return measured.error();
      last_ = trial;
    }
    return std::move(acceptance_);
  }

 private:
  const v1::AcceptanceTrial& Find(uint32_t id) const {
    for (const auto& trial : acceptance_.trials())
      if (trial.id() == id) return trial;
    return v1::AcceptanceTrial::default_instance();
  }

  Result<void> One(const v1::AcceptanceTrial& trial) {
    fmt::print("{} of {}: ", trial.id(), acceptance_.trials_size());
    if (!last_ || !HasSameCondition(*last_, trial)) {
      const auto set = operator_.SetCondition(trial);
      if (auto going = GoesOn(set, trial); !going || !*going) return going ? Result<void>() : going.error();
    }
    if (trial.kind() == v1::TRIAL_KIND_PRESSURE) {
      const auto cleared = operator_.Clear();
      if (auto going = GoesOn(cleared, trial); !going || !*going)
        return going ? Result<void>() : going.error();
      return Measured(trial, v1::TRIAL_PHASE_LOADED, cleared->reference);
    }
    if (!last_) {
      const auto cleared = operator_.Clear();
      if (auto going = GoesOn(cleared, trial); !going || !*going)
        return going ? Result<void>() : going.error();
      if (auto measured = Measured(trial, v1::TRIAL_PHASE_UNLOADED, {}); !measured) return measured;
    }
    const auto loaded = operator_.Load(trial);
    if (auto going = GoesOn(loaded, trial); !going || !*going) return going ? Result<void>() : going.error();
    if (auto measured = Measured(trial, v1::TRIAL_PHASE_LOADED, loaded->reference); !measured)
      return measured;
    const auto released = operator_.Release(trial);
    if (!released) return released.error();
    if (released->kind == Kind::kStop) return kStopped;
    return Measured(trial, v1::TRIAL_PHASE_RELEASED, {});
  }

  // False: the trial is skipped.
  Result<bool> GoesOn(const Result<TrialAnswer>& answer, const v1::AcceptanceTrial& trial) {
    if (!answer) return answer.error();
    if (answer->kind == Kind::kStop) return kStopped;
    if (answer->kind == Kind::kReady) return true;
    v1::SkipTrialRequest request;
    request.set_link(acceptance_.link());
    request.set_trial(trial.id());
    auto skipped = calls_.Skip(request);
    if (!skipped) return skipped.error();
    acceptance_ = *std::move(skipped);
    fmt::print("  skipped\n");
    return false;
  }

  Result<void> Measured(const v1::AcceptanceTrial& trial, v1::TrialPhase phase,
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
    return {};
  }

  client::Acceptances& calls_;
  v1::Acceptance acceptance_;
  TrialOperator& operator_;
  std::optional<v1::AcceptanceTrial> last_;
};

}  // namespace

Result<v1::Acceptance> MeasureTrials(client::Acceptances& calls, v1::Acceptance acceptance,
                                     TrialOperator& trial_operator) {
  return Run(calls, std::move(acceptance), trial_operator).All();
}

}  // namespace taclink::command
