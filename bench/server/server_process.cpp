#include "bench/server/server_process.h"

#include <fcntl.h>
#include <sys/prctl.h>
#include <sys/wait.h>
#include <unistd.h>

#include <chrono>
#include <csignal>
#include <cstring>
#include <filesystem>
#include <fstream>
#include <sstream>
#include <thread>

namespace taclink::command {
namespace {

constexpr std::chrono::seconds kStartPatience{120};
constexpr const char* kListening = "listening on ";

double TicksToSeconds(double ticks) {
  return ticks / static_cast<double>(sysconf(_SC_CLK_TCK));
}

std::string ReadAll(const std::string& path) {
  std::ostringstream text;
  if (const std::ifstream file(path); file) text << file.rdbuf();
  return text.str();
}

ProcessUsage UsageOf(const std::string& process) {
  ProcessUsage usage;
  const std::string stat = ReadAll("/proc/" + process + "/stat");
  // After the name in brackets, which may hold anything: utime and stime are the 12th and 13th words.
  std::istringstream words(stat.substr(std::min(stat.rfind(')') + 1, stat.size())));
  std::string skipped;
  for (int i = 0; i < 11; ++i) words >> skipped;
  double user = 0, system = 0;
  words >> user >> system;
  usage.cpu_s = TicksToSeconds(user + system);
  std::ifstream memory("/proc/" + process + "/statm");
  double all = 0, resident = 0;
  memory >> all >> resident;
  usage.resident_mb = resident * static_cast<double>(sysconf(_SC_PAGESIZE)) / (1 << 20);
  return usage;
}

[[noreturn]] void Become(const std::string& program, const std::string& config, int log) {
  prctl(PR_SET_PDEATHSIG, SIGKILL);
  dup2(log, STDOUT_FILENO);
  dup2(log, STDERR_FILENO);
  execl(program.c_str(), program.c_str(), "--config", config.c_str(), "--listen", "127.0.0.1:0", nullptr);
  _exit(127);
}

}  // namespace

ProcessUsage OwnUsage() {
  return UsageOf("self");
}

ProcessUsage MachineUsage() {
  std::ifstream stat("/proc/stat");
  std::string name;
  double user = 0, nice = 0, system = 0, idle = 0, waiting = 0, irq = 0, softirq = 0;
  stat >> name >> user >> nice >> system >> idle >> waiting >> irq >> softirq;
  return {.cpu_s = TicksToSeconds(user + nice + system + irq + softirq), .resident_mb = 0};
}

ProcessUsage ServerProcess::Usage() const {
  return UsageOf(std::to_string(pid_));
}

bool ServerProcess::Running() {
  if (pid_ > 0 && waitpid(pid_, nullptr, WNOHANG) == pid_) pid_ = -1;
  return pid_ > 0;
}

Result<std::unique_ptr<ServerProcess>> ServerProcess::Start(const std::string& program,
                                                            const std::string& config,
                                                            const std::string& log) {
  std::error_code failed;
  const std::string path =
      program.empty()
          ? (std::filesystem::read_symlink("/proc/self/exe", failed).parent_path() / "taclinkd").string()
          : program;
  if (access(path.c_str(), X_OK) != 0)
    return Error{ErrorCode::kNotFound, path + ": no such program; name it with --taclinkd"};
  const int file = open(log.c_str(), O_CREAT | O_TRUNC | O_WRONLY | O_CLOEXEC, 0600);
  if (file < 0) return Error{ErrorCode::kUnavailable, log + ": cannot be written"};
  const pid_t pid = fork();
  if (pid == 0) Become(path, config, file);
  close(file);
  if (pid < 0) return Error{ErrorCode::kUnavailable, "no process could be started for " + path};
  std::unique_ptr<ServerProcess> server(new ServerProcess(pid));
  const auto give_up = std::chrono::steady_clock::now() + kStartPatience;
  while (true) {
    const bool running = server->Running();
    const std::string text = ReadAll(log);
    const size_t at = text.find(kListening);
    const size_t end =
        text.find_first_of(" \n\"", at == std::string::npos ? at : at + std::strlen(kListening));
    if (at != std::string::npos && end != std::string::npos) {
      server->address_ = text.substr(at + std::strlen(kListening), end - at - std::strlen(kListening));
      return server;
    }
    if (!running || std::chrono::steady_clock::now() > give_up)
      return Error{ErrorCode::kUnavailable, path + " does not serve: " + text};
    std::this_thread::sleep_for(std::chrono::milliseconds(20));
  }
}

ServerProcess::~ServerProcess() {
  if (!Running()) return;
  kill(pid_, SIGTERM);
  for (int i = 0; i < 250 && Running(); ++i) std::this_thread::sleep_for(std::chrono::milliseconds(20));
  if (!Running()) return;
  kill(pid_, SIGKILL);
  waitpid(pid_, nullptr, 0);
}

}  // namespace taclink::command
