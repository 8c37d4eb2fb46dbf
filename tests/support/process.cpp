#include "tests/support/process.h"

#include <fcntl.h>
#include <poll.h>
#include <signal.h>
#include <sys/wait.h>
#include <unistd.h>

#include <fstream>
#include <stdexcept>

namespace taclink::testing {

using std::chrono::steady_clock;

Process::Process(const std::vector<std::string>& command) {
  std::vector<char*> argv;
  for (const auto& word : command) argv.push_back(const_cast<char*>(word.c_str()));
  argv.push_back(nullptr);
  int out[2], err[2];
  if (pipe2(out, O_CLOEXEC) != 0 || pipe2(err, O_CLOEXEC) != 0) throw std::runtime_error("pipe");
  pid_ = fork();
  if (pid_ == 0) {
    dup2(out[1], STDOUT_FILENO);
    dup2(err[1], STDERR_FILENO);
    execv(argv[0], argv.data());
    _exit(127);
  }
  close(out[1]);
  close(err[1]);
  pipes_[0] = out[0];
  pipes_[1] = err[0];
}

Process::~Process() {
  if (pid_ > 0) {
    kill(pid_, SIGCONT);
    kill(pid_, SIGKILL);
    waitpid(pid_, nullptr, 0);
  }
  for (const int fd : pipes_) {
    if (fd >= 0) close(fd);
  }
}

void Process::Signal(int signal) const {
  kill(pid_, signal);
}

bool Process::ReadMore(std::chrono::milliseconds timeout) {
  pollfd fds[2] = {{pipes_[0], POLLIN, 0}, {pipes_[1], POLLIN, 0}};
  if (poll(fds, 2, static_cast<int>(timeout.count())) <= 0) return false;
  bool any = false;
  for (int i = 0; i < 2; ++i) {
    if (fds[i].revents == 0) continue;
    char bytes[65536];
    const ssize_t n = read(pipes_[i], bytes, sizeof bytes);
    if (n > 0) {
      buffers_[i].append(bytes, static_cast<size_t>(n));
      any = true;
    } else {
      close(pipes_[i]);
      pipes_[i] = -1;  // poll skips negative descriptors
    }
  }
  return any || pipes_[0] >= 0 || pipes_[1] >= 0;
}

std::optional<std::string> Process::ReadLine(std::chrono::seconds timeout, bool from_err) {
  std::string& buffer = buffers_[from_err ? 1 : 0];
  const auto end = steady_clock::now() + timeout;
  while (true) {
    if (const auto at = buffer.find('\n'); at != std::string::npos) {
      std::string line = buffer.substr(0, at);
      buffer.erase(0, at + 1);
      return line;
    }
    const auto left = std::chrono::duration_cast<std::chrono::milliseconds>(end - steady_clock::now());
    if (left.count() <= 0 || pipes_[from_err ? 1 : 0] < 0 || !ReadMore(left)) return std::nullopt;
  }
}

std::optional<std::string> Process::ReadUntil(const std::string& text, std::chrono::seconds timeout,
                                              bool from_err) {
  const auto end = steady_clock::now() + timeout;
  while (steady_clock::now() < end) {
    auto line =
        ReadLine(std::chrono::duration_cast<std::chrono::seconds>(end - steady_clock::now()), from_err);
    if (!line || line->find(text) != std::string::npos) return line;
  }
  return std::nullopt;
}

Finished Process::Wait(std::chrono::seconds timeout) {
  const auto end = steady_clock::now() + timeout;
  while (pipes_[0] >= 0 || pipes_[1] >= 0) {
    const auto left = std::chrono::duration_cast<std::chrono::milliseconds>(end - steady_clock::now());
    if (left.count() <= 0) {
      kill(pid_, SIGKILL);
      break;
    }
    ReadMore(left);
  }
  const bool late = steady_clock::now() >= end;
  int status = 0;
  waitpid(pid_, &status, 0);
  pid_ = -1;
  return {late ? -2 : WIFEXITED(status) ? WEXITSTATUS(status) : -1, buffers_[0], buffers_[1]};
}

long Process::ResidentKb() const {
  std::ifstream status("/proc/" + std::to_string(pid_) + "/status");
  std::string word;
  while (status >> word) {
    long kb = 0;
    if (word == "VmRSS:" && status >> kb) return kb;
  }
  return -1;
}

Finished RunToEnd(const std::vector<std::string>& command, std::chrono::seconds timeout) {
  Process process(command);
  return process.Wait(timeout);
}

}  // namespace taclink::testing
