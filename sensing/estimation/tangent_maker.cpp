#include "sensing/estimation/tangent_maker.h"

#include <sys/resource.h>
#include <unistd.h>

#include <utility>

namespace taclink {
namespace {

// Of Linux' 19: the frames' threads of other links go first.
constexpr int kNiceness = 10;

}  // namespace

TangentMaker::TangentMaker(std::unique_ptr<Tangent> spare)
    : spare_(std::move(spare)), thread_([this] { Work(); }) {}

TangentMaker::~TangentMaker() {
  {
    const std::lock_guard lock(mutex_);
    is_ending_ = true;
  }
  changed_.notify_all();
  thread_.join();
}

bool TangentMaker::is_working() const {
  const std::lock_guard lock(mutex_);
  return is_working_;
}

void TangentMaker::Begin(const SkinProblem& problem, const ShellState& state,
                         const Eigen::VectorXd& local_n) {
  problem_ = problem;
  state_ = state;
  local_n_ = local_n;
  {
    const std::lock_guard lock(mutex_);
    is_working_ = true;
  }
  changed_.notify_all();
}

void TangentMaker::Wait() {
  std::unique_lock lock(mutex_);
  changed_.wait(lock, [this] { return !is_working_; });
}

void TangentMaker::Work() {
  // A thread's own on Linux. A system that refuses it shares the processor evenly.
  setpriority(PRIO_PROCESS, static_cast<id_t>(gettid()), kNiceness);
  std::unique_lock lock(mutex_);
  while (true) {
    changed_.wait(lock, [this] { return is_working_ || is_ending_; });
    if (is_ending_) return;
    lock.unlock();
    spare_->Make(problem_, state_, local_n_);
    lock.lock();
    is_working_ = false;
    changed_.notify_all();
  }
}

}  // namespace taclink
