// What a user sees of the live path: simulated scenes through the server's default pipeline at the cameras'
// rate, in real time. One process per case, so that memory is the case's own. Run it in the repository's
// root.
//
//   taclink_live_report [--cores N] [--seconds S] [--folder SCENES] [CASE ...]
//
// A case is a shipped scene, a scene of the folder, `demo`: the links of deploy/config/demo.yaml at once, or
// `swinging-arm`: those that deploy/demo starts.
// Prints one line per case:
//
// - latency: exposure to published state, ms, of all frames and of those with a contact
// - cpu: CPU time of all threads between two frames, ms, with the rendering of the cameras' images
// - skip %: frames that were exposed and not solved; not ok: frames whose status is not `ok`, in percent
// - MiB: resident size at the end
//
// Above them stands the unit that makes machines comparable: u, the cost of one residual (internal forces),
// element by element, and one back substitution of the dense block factor on the default mesh, ms. The
// estimator has faster ones by now: the unit stays, so that ratios remain comparable.
#include <fmt/format.h>
#include <sched.h>
#include <spdlog/spdlog.h>
#include <sys/wait.h>
#include <unistd.h>

#include <algorithm>
#include <chrono>
#include <condition_variable>
#include <cstdlib>
#include <ctime>
#include <filesystem>
#include <fstream>
#include <mutex>
#include <string>
#include <thread>
#include <vector>

#include "sensing/estimation/skin_mechanics.h"
#include "sensing/model/model_file.h"
#include "sensing/shell/block_tridiagonal.h"
#include "sensing/shell/element_load.h"
#include "sensing/simulation/scene.h"
#include "server/assembly/arm_builder.h"
#include "server/config/config.h"
#include "server/process/heap.h"

namespace taclink::server {
namespace {

using std::chrono::milliseconds;
using std::chrono::seconds;
using Steady = std::chrono::steady_clock;

struct Options {
  int cores = 2;
  int seconds = 30;
  std::string folder = "bench/micro/scenes";
  std::vector<std::string> cases;
};

double CpuMs() {
  timespec time{};
  clock_gettime(CLOCK_PROCESS_CPUTIME_ID, &time);
  return 1e3 * static_cast<double>(time.tv_sec) + 1e-6 * static_cast<double>(time.tv_nsec);
}

double ResidentMib() {
  std::ifstream file("/proc/self/statm");
  double total = 0, resident = 0;
  file >> total >> resident;
  return resident * static_cast<double>(sysconf(_SC_PAGESIZE)) / (1 << 20);
}

/// Restricts the process to the first `cores` of the processors that it may use.
bool UseCores(int cores) {
  cpu_set_t allowed, chosen;
  CPU_ZERO(&chosen);
  if (sched_getaffinity(0, sizeof allowed, &allowed) != 0) return false;
  for (int cpu = 0; cpu < CPU_SETSIZE && CPU_COUNT(&chosen) < cores; ++cpu) {
    if (CPU_ISSET(cpu, &allowed)) CPU_SET(cpu, &chosen);
  }
  return CPU_COUNT(&chosen) == cores && sched_setaffinity(0, sizeof chosen, &chosen) == 0;
}

/// The unit in which costs are comparable between machines, ms; the median of many.
double UnitMs(const LinkModel& model) {
  const SkinMechanics mechanics(model);
  ShellSurface surface = mechanics.shell().surface();
  surface.columns = 0;  // element by element
  const NonlinearShell shell(std::move(surface), model.material);
  const ShellState state = shell.Rest();
  const FollowerPressure pressure(0);
  const ElementLoad* loads[] = {&pressure};
  Eigen::SparseMatrix<double> hessian = shell.Pattern();
  Eigen::VectorXd gradient, motion;
  shell.Hessian(state, loads, gradient, hessian);
  BlockTridiagonal factor(hessian.rows() / mechanics.site_rows(), mechanics.site_rows());
  if (!factor.Factorise(hessian)) return 0;
  std::vector<double> times_ms;
  for (int i = 0; i < 200; ++i) {
    const auto begin = Steady::now();
    shell.Gradient(state, loads, gradient);
    factor.Solve(gradient, motion);
    times_ms.push_back(std::chrono::duration<double, std::milli>(Steady::now() - begin).count());
  }
  std::nth_element(times_ms.begin(), times_ms.begin() + 100, times_ms.end());
  return times_ms[100];
}

struct Distribution {
  explicit Distribution(std::vector<double> all) : values(std::move(all)) {
    std::sort(values.begin(), values.end());
  }
  double At(size_t permille) const {
    return values.empty() ? 0 : values[(values.size() - 1) * permille / 1000];
  }
  std::string Text() const {
    return fmt::format("{:6.1f} {:6.1f} {:6.1f} {:6.1f}", At(500), At(900), At(990), At(1000));
  }
  std::vector<double> values;
};

/// Hands over every state of an arm as it is published.
class States {
 public:
  explicit States(Hub& hub) {
    subscription_ = hub.Subscribe({.delivery = Delivery::kEvery, .queue_capacity = 4096}, [this] {
      const std::lock_guard lock(mutex_);
      is_there_ = true;
      arrived_.notify_one();
    });
  }
  /// Null: none within half a second.
  PublicationPtr Next() {
    if (auto next = subscription_->Take()) return next;
    std::unique_lock lock(mutex_);
    arrived_.wait_for(lock, milliseconds(500), [this] { return is_there_; });
    is_there_ = false;
    lock.unlock();
    return subscription_->Take();
  }

 private:
  std::mutex mutex_;
  std::condition_variable arrived_;
  bool is_there_ = false;  // guarded by mutex_
  std::unique_ptr<Subscription> subscription_;
};

struct Case {
  std::string name;
  std::string scene;          // name or file; empty: a configuration
  std::string configuration;  // file
};

/// The case's links, with scenes that go by the clock.
Result<Config> CaseConfig(const Case& measured) {
  if (measured.scene.empty()) {
    auto arm = LoadConfig(measured.configuration);
    if (arm) {
      for (LinkConfig& link : arm->links) {
        std::get<SimulatedSourceConfig>(link.source).pace = ScenePace::kClock;
      }
    }
    return arm;
  }
  const auto scene = LoadScene(measured.scene);
  if (!scene) return scene.error();
  return ParseConfig(
      measured.name,
      fmt::format("taclink_config: 1\narm:\n  name: bench\n  links:\n    - {{name: link, model: "
                  "{}, source: simulated, scene: {}, pace: clock}}\n",
                  scene->model, measured.scene),
      ".");
}

/// Waits until all links are `ok`, at most three minutes.
bool WaitUntilOk(Arm& arm) {
  const auto end = Steady::now() + seconds(180);
  while (Steady::now() < end) {
    bool all_ok = true;
    for (size_t link = 0; link < arm.links().size(); ++link) {
      const PublicationPtr latest = arm.hub().Latest(link);
      all_ok = all_ok && latest && latest->state().status == LinkStatus::kOk;
    }
    if (all_ok) return true;
    std::this_thread::sleep_for(milliseconds(100));
  }
  return false;
}

/// Frames of all links that were solved and that were skipped, so far.
struct FrameCounts {
  explicit FrameCounts(Arm& arm) {
    for (size_t link = 0; link < arm.links().size(); ++link) {
      const LinkStatistics statistics = arm.worker(link).Statistics();
      solved += statistics.frames;
      skipped += statistics.frames_skipped;
    }
  }
  uint64_t solved = 0, skipped = 0;
};

/// Runs the case and prints the line of its results.
bool Report(const Case& measured, const Options& options) {
  const auto config = CaseConfig(measured);
  const auto arm = config ? BuildArm(*config, SystemClock()) : config.error();
  if (!arm) {
    fmt::print(stderr, "{}: {}\n", measured.name, arm.error().message);
    return false;
  }
  (*arm)->Start();
  if (!WaitUntilOk(**arm)) {
    fmt::print(stderr, "{}: not every link is ok after three minutes\n", measured.name);
    return false;
  }
  const FrameCounts before(**arm);
  std::vector<double> all_ms, touched_ms, cpu_ms;
  size_t frames = 0, not_ok = 0;
  const double cpu_begin_ms = CpuMs();
  const auto begin = Steady::now();
  {
    States states((*arm)->hub());
    double last_ms = cpu_begin_ms;
    while (Steady::now() < begin + seconds(options.seconds)) {
      const PublicationPtr next = states.Next();
      if (!next || next->state().times.exposure_monotonic_ns == 0) continue;
      const LinkState& state = next->state();
      const double ms =
          1e-6 * static_cast<double>(state.times.published_ns - state.times.exposure_monotonic_ns);
      const double now_ms = CpuMs();
      all_ms.push_back(ms);
      cpu_ms.push_back(now_ms - std::exchange(last_ms, now_ms));
      if (!state.contacts.empty()) touched_ms.push_back(ms);
      if (state.status != LinkStatus::kOk) ++not_ok;
      ++frames;
    }
  }
  const double wall_ms = std::chrono::duration<double, std::milli>(Steady::now() - begin).count();
  const double cores = (CpuMs() - cpu_begin_ms) / wall_ms;
  const FrameCounts after(**arm);
  const uint64_t solved = after.solved - before.solved, skipped = after.skipped - before.skipped;
  fmt::print(
      "{:<14} {} | {} | {} | {:5.2f} {:6.2f} {:6.2f} {:7.0f}\n", measured.name, Distribution(all_ms).Text(),
      Distribution(touched_ms).Text(), Distribution(cpu_ms).Text(), cores,
      100.0 * static_cast<double>(skipped) / static_cast<double>(std::max<uint64_t>(1, solved + skipped)),
      100.0 * static_cast<double>(not_ok) / static_cast<double>(std::max<size_t>(1, frames)), ResidentMib());
  std::fflush(stdout);
  (*arm)->Stop();
  return true;
}

Result<Options> Parse(int argc, char** argv) {
  Options options;
  for (int i = 1; i < argc; ++i) {
    const std::string argument = argv[i];
    const auto value = [&] { return i + 1 < argc ? std::string(argv[++i]) : std::string(); };
    if (argument == "--cores")
      options.cores = std::atoi(value().c_str());
    else if (argument == "--seconds")
      options.seconds = std::atoi(value().c_str());
    else if (argument == "--folder")
      options.folder = value();
    else if (argument.starts_with("-"))
      return Error{
          ErrorCode::kInvalidArgument,
          argument + ": usage: taclink_live_report [--cores N] [--seconds S] [--folder SCENES] [CASE ...]"};
    else
      options.cases.push_back(argument);
  }
  if (options.cores < 1 || options.seconds < 1)
    return Error{ErrorCode::kInvalidArgument, "--cores and --seconds must be whole numbers from 1"};
  return options;
}

std::vector<Case> Cases(const Options& options) {
  std::vector<Case> cases;
  for (const std::string& name : ShippedSceneNames()) cases.push_back({name, name, {}});
  std::vector<std::filesystem::path> files;
  if (std::filesystem::is_directory(options.folder)) {
    for (const auto& entry : std::filesystem::directory_iterator(options.folder))
      files.push_back(entry.path());
  }
  std::sort(files.begin(), files.end());
  for (const auto& file : files)
    cases.push_back({file.stem().string(), std::filesystem::absolute(file).string(), {}});
  cases.push_back({"demo", {}, "deploy/config/demo.yaml"});
  cases.push_back({"swinging-arm", {}, "deploy/config/swinging-arm.yaml"});
  if (!options.cases.empty()) {
    std::erase_if(cases, [&](const Case& each) {
      return std::find(options.cases.begin(), options.cases.end(), each.name) == options.cases.end();
    });
  }
  return cases;
}

int Main(int argc, char** argv) {
  const auto options = Parse(argc, argv);
  if (!options) {
    fmt::print(stderr, "taclink_live_report: {}\n", options.error().message);
    return 2;
  }
  if (!UseCores(options->cores)) {
    fmt::print(stderr, "taclink_live_report: {} cores are not to be had\n", options->cores);
    return 1;
  }
  spdlog::set_level(spdlog::level::warn);
  ReturnLargeBlocks();
  const auto cases = Cases(*options);
  if (cases.empty()) {
    fmt::print(stderr, "taclink_live_report: no such case\n");
    return 2;
  }
  fmt::print("cores {}, u = {:.3f} ms (cylinder), {:.3f} ms (barrel)\n", options->cores,
             UnitMs(LoadLinkModel("cylinder").value()), UnitMs(LoadLinkModel("barrel").value()));
  const char* columns = "   p50    p90    p99  worst";
  fmt::print("{:<14} {} | {} | {} | {:>5} {:>6} {:>6} {:>7}\n", "", fmt::format("{:^27}", "latency, ms"),
             fmt::format("{:^27}", "touched, ms"), fmt::format("{:^27}", "cpu per frame, ms"), "", "", "",
             "");
  fmt::print("{:<14} {} | {} | {} | {:>5} {:>6} {:>6} {:>7}\n", "case", columns, columns, columns, "cores",
             "skip %", "not ok", "MiB");
  std::fflush(stdout);
  bool is_good = true;
  for (const Case& measured : cases) {
    const pid_t child = fork();
    if (child == 0) _exit(Report(measured, *options) ? 0 : 1);
    int status = 0;
    is_good = child > 0 && waitpid(child, &status, 0) == child && status == 0 && is_good;
  }
  return is_good ? 0 : 1;
}

}  // namespace
}  // namespace taclink::server

int main(int argc, char** argv) {
  return taclink::server::Main(argc, argv);
}
