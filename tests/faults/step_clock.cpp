// A clock that a test may step: loaded into a program before all else (LD_PRELOAD), it adds to the wall clock
// the nanoseconds that stand in the file TACLINK_STEP_CLOCK. The file is mapped and never read: programs
// without free descriptors tell the time, too. Monotonic clocks go on as they are, as they do when a
// machine's clock is set.
#include <fcntl.h>
#include <sys/mman.h>
#include <sys/syscall.h>
#include <sys/time.h>
#include <time.h>
#include <unistd.h>

#include <atomic>
#include <cstdint>
#include <cstdlib>

namespace {

constexpr int64_t kNsPerS = 1'000'000'000;

const std::atomic<int64_t>* MapStep() {
  static const std::atomic<int64_t> none{0};
  const char* const path = std::getenv("TACLINK_STEP_CLOCK");
  const int file = path == nullptr ? -1 : ::open(path, O_RDONLY | O_CLOEXEC);
  if (file < 0) return &none;
  void* const bytes = ::mmap(nullptr, sizeof(int64_t), PROT_READ, MAP_SHARED, file, 0);
  ::close(file);
  return bytes == MAP_FAILED ? &none : static_cast<const std::atomic<int64_t>*>(bytes);
}

int64_t StepNs() {
  static const std::atomic<int64_t>* const step = MapStep();
  return step->load(std::memory_order_relaxed);
}

bool IsWallClock(clockid_t clock) {
  return clock == CLOCK_REALTIME || clock == CLOCK_REALTIME_COARSE;
}

}  // namespace

// The names are the C library's.
// NOLINTBEGIN(readability-identifier-naming)
extern "C" int clock_gettime(clockid_t clock, timespec* out) noexcept {
  if (::syscall(SYS_clock_gettime, clock, out) != 0) return -1;
  if (!IsWallClock(clock)) return 0;
  const int64_t ns = out->tv_sec * kNsPerS + out->tv_nsec + StepNs();
  *out = {.tv_sec = ns / kNsPerS, .tv_nsec = ns % kNsPerS};
  return 0;
}

extern "C" int gettimeofday(timeval* out, void* /*zone*/) noexcept {
  timespec now{};
  clock_gettime(CLOCK_REALTIME, &now);
  *out = {.tv_sec = now.tv_sec, .tv_usec = now.tv_nsec / 1000};
  return 0;
}

extern "C" time_t time(time_t* out) noexcept {
  timespec now{};
  clock_gettime(CLOCK_REALTIME, &now);
  if (out != nullptr) *out = now.tv_sec;
  return now.tv_sec;
}
// NOLINTEND(readability-identifier-naming)
