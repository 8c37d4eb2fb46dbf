#include "server/security/failed_tries.h"

namespace taclink::server {
namespace {

constexpr int64_t kWindowNs = 60'000'000'000;
constexpr size_t kMostPlaces = 1024;

}  // namespace

FailedTries::Entry& FailedTries::Find(const std::string& place, int64_t now_ns) {
  const auto known = entries_.find(place);
  if (known != entries_.end()) return known->second;
  if (entries_.size() >= kMostPlaces)
    std::erase_if(entries_, [&](const auto& entry) { return now_ns - entry.second.begin_ns >= kWindowNs; });
  return entries_.size() < kMostPlaces ? entries_[place] : others_;
}

FailedTries::Verdict FailedTries::Count(const std::string& place, int64_t now_ns) {
  const std::lock_guard lock(mutex_);
  if (a_minute_ == 0) return {};
  Entry& entry = Find(place, now_ns);
  if (entry.tries == 0 || now_ns - entry.begin_ns >= kWindowNs) entry = {.begin_ns = now_ns, .tries = 0};
  if (entry.tries < a_minute_) {
    ++entry.tries;
    return {};
  }
  ++throttled_;
  if (told_ && now_ns - told_ns_ < kWindowNs) return {.too_many = true, .tell = false};
  told_ = true;
  told_ns_ = now_ns;
  return {.too_many = true, .tell = true};
}

uint64_t FailedTries::throttled() const {
  const std::lock_guard lock(mutex_);
  return throttled_;
}

size_t FailedTries::places() const {
  const std::lock_guard lock(mutex_);
  return entries_.size();
}

}  // namespace taclink::server
