#include "bench/tools/child_process.h"

#include <malloc.h>
#include <poll.h>
#include <sys/wait.h>
#include <unistd.h>

#include <csignal>
#include <cstdlib>
#include <fstream>

namespace taclink {
namespace {

constexpr size_t kMostCharacters = 4000;  // fit a pipe, so that they are written at once
constexpr int kMakeSeconds = 120;

double ResidentMb() {
  std::ifstream statm("/proc/self/statm");
  double all = 0, resident = 0;
  statm >> all >> resident;
  return resident * static_cast<double>(sysconf(_SC_PAGESIZE)) * 1e-6;
}

}  // namespace

std::optional<std::string> InChildProcess(const std::function<std::string()>& run, int most_s) {
  int ends[2];
  if (pipe(ends) != 0) return std::nullopt;
  const pid_t child = fork();
  if (child == 0) {
    // A first byte, so that an empty answer is one too.
    const std::string answer = "=" + run().substr(0, kMostCharacters);
    const bool told = write(ends[1], answer.data(), answer.size()) == static_cast<ssize_t>(answer.size());
    _exit(told ? 0 : 1);
  }
  close(ends[1]);
  std::string answer(kMostCharacters + 1, '\0');
  pollfd waiting{.fd = ends[0], .events = POLLIN, .revents = 0};
  ssize_t size = 0;
  if (child > 0 && poll(&waiting, 1, 1000 * most_s) > 0) size = read(ends[0], answer.data(), answer.size());
  close(ends[0]);
  if (child > 0) {
    if (size <= 0) kill(child, SIGKILL);
    waitpid(child, nullptr, 0);
  }
  if (size <= 0) return std::nullopt;
  return answer.substr(1, static_cast<size_t>(size) - 1);
}

double ResidentGrowthMb(const std::function<std::shared_ptr<void>()>& make) {
  const auto grown = InChildProcess(
      [&] {
        malloc_trim(0);
        const double before = ResidentMb();
        const std::shared_ptr<void> made = make();
        malloc_trim(0);
        return std::to_string(ResidentMb() - before);
      },
      kMakeSeconds);
  return grown ? std::strtod(grown->c_str(), nullptr) : 0;
}

}  // namespace taclink
