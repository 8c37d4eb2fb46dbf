#pragma once

#include <condition_variable>
#include <memory>
#include <mutex>
#include <thread>

#include "sensing/estimation/tangent.h"

namespace taclink {

/// Makes a tangent in a thread of its own, which gives way to all others, while frames go on with the one at
/// hand. One caller; the spare tangent is the thread's while it works and the caller's otherwise.
class TangentMaker {
 public:
  explicit TangentMaker(std::unique_ptr<Tangent> spare);
  ~TangentMaker();
  TangentMaker(const TangentMaker&) = delete;
  TangentMaker& operator=(const TangentMaker&) = delete;

  bool is_working() const;
  /// While it is not working: begins with copies of these.
  void Begin(const SkinProblem& problem, const ShellState& state, const Eigen::VectorXd& local_n);
  void Wait();
  /// While it is not working: what was made last, to be looked at and exchanged.
  std::unique_ptr<Tangent>& spare() { return spare_; }

 private:
  void Work();

  std::unique_ptr<Tangent> spare_;
  SkinProblem problem_;
  ShellState state_;
  Eigen::VectorXd local_n_;

  mutable std::mutex mutex_;
  std::condition_variable changed_;
  bool is_working_ = false, is_ending_ = false;  // by mutex_
  std::thread thread_;
};

}  // namespace taclink
