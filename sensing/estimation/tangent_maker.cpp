#include "sensing/estimation/tangent_maker.h"

#include <atomic>
#include <future>
#include <utility>

namespace taclink {

struct TangentMaker::Work {
  // True: mine to do.
  bool Take() { return !taken.exchange(true); }

  std::atomic<bool> taken = false;
  std::promise<void> done;
};

TangentMaker::TangentMaker(std::unique_ptr<Tangent> spare, BackgroundRunner background)
    : spare_(std::move(spare)), background_(std::move(background)) {}

TangentMaker::~TangentMaker() {
  if (work_ && !work_->Take()) work_->done.get_future().wait();
}

void TangentMaker::Begin(const SkinProblem& problem, const ShellState& state, const Eigen::VectorXd& local_n,
                         std::shared_ptr<const UntouchedCovariance> untouched) {
  problem_ = problem;
  state_ = state;
  local_n_ = local_n;
  untouched_ = std::move(untouched);
  work_ = std::make_shared<Work>();
  if (!background_) return;
  background_([this, work = work_] {
    if (!work->Take()) return;
    Make();
    work->done.set_value();
  });
}

void TangentMaker::Finish() {
  if (!work_) return;
  if (work_->Take())
    Make();
  else
    work_->done.get_future().wait();
  work_.reset();
}

}  // namespace taclink
