#include "server/process/log_writer.h"

#include <fcntl.h>
#include <poll.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <condition_variable>
#include <deque>
#include <filesystem>
#include <mutex>
#include <system_error>
#include <utility>

#include "sensing/core/thread_start.h"

namespace taclink::server {

struct LogWriter::State {
  State(Write the_write, CountLine the_count_line, const Limits& the_limits, Now the_now)
      : write(std::move(the_write)),
        count_line(std::move(the_count_line)),
        limits(the_limits),
        now(std::move(the_now)),
        write_began(now()) {}

  void Run();
  void WriteLine(const std::string& line);
  bool WriteCount();
  bool WriteAll(std::string_view bytes);

  const Write write;
  const CountLine count_line;
  const Limits limits;
  const Now now;

  std::mutex mutex;
  std::condition_variable changed, progress;
  // Guarded by the mutex.
  std::deque<std::string> lines;
  size_t bytes = 0;
  size_t left_out = 0;  // since the queue was full; not zero: no line is taken before it is empty
  Clock::time_point left_out_since;
  size_t accepted = 0, done = 0;  // lines, and counts of lines
  Clock::time_point write_began;
  bool is_writing = false;
  bool is_ending = false;

  // The thread's alone: what its next line of a count tells.
  size_t missing = 0;
  Clock::time_point missing_since;
  int error = 0;
  bool is_torn = false;  // a write failed within a line
};

namespace {

void CloseDescriptor(const int* descriptor) {
  ::close(*descriptor);
  delete descriptor;
}

ssize_t WriteOrWait(int descriptor, std::string_view bytes) {
  while (true) {
    const ssize_t written = ::write(descriptor, bytes.data(), bytes.size());
    if (written >= 0 || (errno != EINTR && errno != EAGAIN)) return written;
    if (errno == EINTR) continue;
    pollfd room{.fd = descriptor, .events = POLLOUT, .revents = 0};
    ::poll(&room, 1, -1);
  }
}

}  // namespace

LogWriter::LogWriter(Write write, CountLine count_line)
    : LogWriter(std::move(write), std::move(count_line), Limits{}, [] { return Clock::now(); }) {}

LogWriter::LogWriter(Write write, CountLine count_line, const Limits& limits, Now now)
    : state_(std::make_shared<State>(std::move(write), std::move(count_line), limits, std::move(now))) {
  MustStartThread("log", [state = state_] { state->Run(); }).detach();
}

LogWriter::~LogWriter() {
  const std::lock_guard lock(state_->mutex);
  state_->is_ending = true;
  state_->changed.notify_one();
}

void LogWriter::Push(std::string line) {
  State& state = *state_;
  const std::lock_guard lock(state.mutex);
  const bool has_room =
      state.lines.size() < state.limits.lines && state.bytes + line.size() <= state.limits.bytes;
  if (state.left_out > 0 || !has_room) {
    if (state.left_out++ == 0) {
      state.left_out_since = state.is_writing ? state.write_began : state.now();
      ++state.accepted;
    }
  } else {
    ++state.accepted;
    state.bytes += line.size();
    state.lines.push_back(std::move(line));
  }
  state.changed.notify_one();
}

bool LogWriter::Flush(std::chrono::milliseconds limit) {
  std::unique_lock lock(state_->mutex);
  return state_->progress.wait_for(lock, limit,
                                   [this, until = state_->accepted] { return state_->done >= until; });
}

void LogWriter::State::Run() {
  std::unique_lock lock(mutex);
  while (true) {
    changed.wait(lock, [this] { return !lines.empty() || left_out > 0 || is_ending; });
    if (lines.empty() && left_out == 0) return;
    std::string line;
    if (!lines.empty()) {
      line = std::move(lines.front());
      lines.pop_front();
      bytes -= line.size();
    } else {
      if (missing == 0) missing_since = left_out_since;
      missing += std::exchange(left_out, 0);
    }
    is_writing = true;
    write_began = now();
    lock.unlock();
    WriteLine(line);
    lock.lock();
    is_writing = false;
    ++done;
    progress.notify_all();
  }
}

// Empty: only the count.
void LogWriter::State::WriteLine(const std::string& line) {
  if ((missing == 0 || WriteCount()) && WriteAll(line)) return;
  if (line.empty()) return;
  if (missing++ == 0) missing_since = now();
}

bool LogWriter::State::WriteCount() {
  if (!WriteAll(count_line({.count = missing, .during = now() - missing_since, .error = error})))
    return false;
  missing = 0;
  error = 0;
  return true;
}

bool LogWriter::State::WriteAll(std::string_view bytes_left) {
  const std::string whole = is_torn ? "\n" + std::string(bytes_left) : std::string();
  if (is_torn) bytes_left = whole;
  const size_t size = bytes_left.size();
  while (!bytes_left.empty()) {
    const ssize_t written = write(bytes_left);
    if (written <= 0) {
      error = written < 0 ? errno : EIO;
      is_torn = is_torn || bytes_left.size() < size;
      return false;
    }
    bytes_left.remove_prefix(std::min(static_cast<size_t>(written), bytes_left.size()));
  }
  is_torn = false;
  return true;
}

LogWriter::Write ToDescriptor(int descriptor) {
  return [descriptor](std::string_view bytes) { return WriteOrWait(descriptor, bytes); };
}

Result<LogWriter::Write> ToFile(const std::string& path) {
  std::error_code error;
  if (std::filesystem::exists(path, error) && !std::filesystem::is_regular_file(path, error))
    return Error{ErrorCode::kInvalidArgument, path + " is not a regular file"};
  std::filesystem::create_directories(std::filesystem::path(path).parent_path(), error);
  constexpr mode_t kMode = 0666;  // less the process's umask
  const int descriptor = ::open(path.c_str(), O_WRONLY | O_CREAT | O_APPEND | O_CLOEXEC | O_NOCTTY, kMode);
  if (descriptor < 0)
    return Error{ErrorCode::kUnavailable,
                 path + " cannot be opened for writing: " + std::generic_category().message(errno)};
  const std::shared_ptr<const int> file(new int(descriptor), CloseDescriptor);
  return LogWriter::Write([file](std::string_view bytes) { return WriteOrWait(*file, bytes); });
}

}  // namespace taclink::server
