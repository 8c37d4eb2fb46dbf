#include "sensing/core/thread_start.h"

#include <pthread.h>

#include <mutex>
#include <stdexcept>

namespace taclink {
namespace {

constexpr size_t kThreadNameLength = 15;

std::mutex shortage_mutex;
ThreadShortage* shortage = nullptr;       // guarded by shortage_mutex
constinit std::atomic<int> detached = 0;  // threads

}  // namespace

Error NoThread(const std::string& name, const std::string& reason) {
  return {ErrorCode::kResourceExhausted,
          "no thread can be started for " + name + ": " + reason +
              "; raise TasksMax of the systemd unit, pids.max of the cgroup, or ulimit -u"};
}

void NameThread(const std::string& name) {
  pthread_setname_np(pthread_self(), name.substr(0, kThreadNameLength).c_str());
}

ThreadShortage::ThreadShortage(std::string prefix) : prefix_(std::move(prefix)) {
  const std::lock_guard lock(shortage_mutex);
  shortage = this;
}

ThreadShortage::~ThreadShortage() {
  const std::lock_guard lock(shortage_mutex);
  shortage = nullptr;
}

void ThreadShortage::Check(const std::string& name) {
  const std::lock_guard lock(shortage_mutex);
  if (shortage == nullptr || !name.starts_with(shortage->prefix_)) return;
  ++shortage->refused_;
  throw std::system_error(std::make_error_code(std::errc::resource_unavailable_try_again));
}

int DetachedThreads() {
  return detached;
}

namespace thread_start {

void CountDetached(int change) {
  detached += change;
}

void ThrowNoThread(const Error& error) {
  throw std::runtime_error(error.message);
}

}  // namespace thread_start
}  // namespace taclink
