#pragma once

#include <functional>
#include <memory>

#include "sensing/estimation/tangent.h"

namespace taclink {

/// Runs a job once, later, in another thread, or never: who comes to need a job that has not begun does it
/// himself.
using BackgroundRunner = std::function<void(std::function<void()>)>;

/// Makes a tangent in the background, while frames go on with the one at hand. One caller; the spare tangent
/// is the background's between Begin and Finish and the caller's otherwise. Without a background it is
/// made by Finish.
class TangentMaker {
 public:
  explicit TangentMaker(std::unique_ptr<Tangent> spare, BackgroundRunner background = {});
  ~TangentMaker();
  TangentMaker(const TangentMaker&) = delete;
  TangentMaker& operator=(const TangentMaker&) = delete;

  /// Between Begin and Finish.
  bool is_begun() const { return work_ != nullptr; }
  /// With copies of these. The one before must be finished.
  void Begin(const SkinProblem& problem, const ShellState& state, const Eigen::VectorXd& local_n,
             std::shared_ptr<const UntouchedCovariance> untouched);
  /// Waits for the background or, if that has not come to it, makes the tangent here.
  void Finish();
  /// What was made last, to be looked at and exchanged.
  std::unique_ptr<Tangent>& spare() { return spare_; }

 private:
  struct Work;

  void Make() { spare_->Make(problem_, state_, local_n_, untouched_); }

  std::unique_ptr<Tangent> spare_;
  const BackgroundRunner background_;
  SkinProblem problem_;
  ShellState state_;
  Eigen::VectorXd local_n_;
  std::shared_ptr<const UntouchedCovariance> untouched_;
  // Shared with the job: one that comes after Finish has taken its work finds neither this nor more to do.
  std::shared_ptr<Work> work_;
};

}  // namespace taclink
