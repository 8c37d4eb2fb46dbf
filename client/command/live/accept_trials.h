#pragma once

#include <memory>
#include <optional>
#include <string>

#include "client/cpp/taclink/acceptance.h"

namespace taclink::command {

/// What whoever carries out a trial answers.
struct TrialAnswer {
  /// kRepeat: the trial before this one is done again.
  enum class Kind { kReady, kSkip, kRepeat, kStop };
  Kind kind = Kind::kReady;
  v1::TrialReference reference;  ///< what is known of the load from outside; empty: as planned
};

/// Puts loads on a link and takes them off: a person who is asked, or the simulation.
class TrialOperator {
 public:
  virtual ~TrialOperator() = default;
  /// Nothing touches the link when this returns. Its reference holds what is known of the pressure.
  virtual Result<TrialAnswer> Clear() = 0;
  /// The trial's pressure and attitude are there when this returns. Called where they change.
  virtual Result<TrialAnswer> SetCondition(const v1::AcceptanceTrial& trial) = 0;
  /// The load is on and rests.
  virtual Result<TrialAnswer> Load(const v1::AcceptanceTrial& trial) = 0;
  /// The load is off.
  virtual Result<TrialAnswer> Release(const v1::AcceptanceTrial& trial) = 0;
};

/// Measures all open trials of an acceptance one after the other, and says what came of each. Errors: of the
/// server or the operator; kEndOfData (stopped: what was measured is stored, and the acceptance can be
/// resumed).
Result<v1::Acceptance> MeasureTrials(client::Acceptances& calls, v1::Acceptance acceptance,
                                     TrialOperator& trial_operator);

/// A person at a terminal, or a script on standard input: a line for each question.
struct PersonOptions {
  std::optional<double> force_n;  ///< of the weight in use, in place of the planned one
  std::string gauge;              ///< serial line of a force gauge that sends a number a line; empty: none
  int gauge_baud = 9600;
  double gauge_n_per_unit = 1;
};
/// Errors: kInvalidArgument (a baud rate that serial lines do not have).
Result<std::unique_ptr<TrialOperator>> MakePerson(const PersonOptions& options);

/// Presses bodies on a simulated link, with the true force as the reference. `force_n`: in place of the
/// planned one.
std::unique_ptr<TrialOperator> MakePlayer(client::Client& connection, const v1::Link& link,
                                          std::optional<double> force_n);

}  // namespace taclink::command
