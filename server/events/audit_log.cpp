#include "server/events/audit_log.h"

#include <fcntl.h>
#include <spdlog/spdlog.h>
#include <sys/stat.h>
#include <unistd.h>

#include <cerrno>
#include <ctime>
#include <filesystem>
#include <nlohmann/json.hpp>
#include <system_error>
#include <utility>

namespace taclink::server {
namespace {

namespace fs = std::filesystem;
using Json = nlohmann::ordered_json;

constexpr size_t kMostWaiting = 1000;

std::string TimeText(int64_t utc_ns) {
  const auto seconds = static_cast<std::time_t>(utc_ns / 1'000'000'000);
  std::tm utc{};
  gmtime_r(&seconds, &utc);
  char text[48];
  const size_t length = std::strftime(text, sizeof text, "%Y-%m-%dT%H:%M:%S", &utc);
  std::snprintf(text + length, sizeof text - length, ".%03dZ",
                static_cast<int>(utc_ns % 1'000'000'000 / 1'000'000));
  return text;
}

void AddOperation(const Operation& operation, Json& line) {
  line["who"] = operation.who;
  line["accepted"] = operation.accepted;
  line["outcome"] = operation.outcome;
  line["values"] = Json(operation.values);
}

// What clients send may be no text, or more than text to a terminal.
std::string TextOf(const Json& line) {
  constexpr bool kAscii = true;
  return line.dump(-1, ' ', kAscii, Json::error_handler_t::replace);
}

}  // namespace

std::string AuditLine(const Event& event, const std::string& link) {
  Json line = {{"time", TimeText(event.raised_utc_ns)}, {"what", Name(event.kind)}, {"link", link}};
  if (const auto* operation = std::get_if<Operation>(&event.detail)) {
    AddOperation(*operation, line);
  } else if (const auto* drift = std::get_if<DriftDetail>(&event.detail)) {
    line["who"] = "server";
    line["values"] = {{"drift_m", drift->drift_mm * 1e-3}, {"step_m", drift->step_mm * 1e-3}};
  } else {
    return {};
  }
  return TextOf(line);
}

AuditLog::AuditLog(std::string file, size_t max_bytes) : file_(std::move(file)), max_bytes_(max_bytes) {}

void AuditLog::Write(const Event& event, const std::string& link) {
  const std::string line = AuditLine(event, link);
  if (!line.empty()) WriteLine(line);
}

void AuditLog::Write(const std::string& what, const Operation& operation, int64_t utc_ns) {
  Json line = {{"time", TimeText(utc_ns)}, {"what", what}, {"link", ""}};
  AddOperation(operation, line);
  WriteLine(TextOf(line));
}

void AuditLog::WriteLine(std::string line) {
  if (file_.empty()) return;
  waiting_.push_back(std::move(line += '\n'));
  while (!waiting_.empty()) {
    if (const auto written = Append(waiting_.front()); !written) {
      if (!std::exchange(failing_, true))
        SPDLOG_ERROR("audit file {}: {}; the newest {} entries wait", file_, written.error().message,
                     kMostWaiting);
      break;
    }
    waiting_.pop_front();
  }
  if (waiting_.empty() && std::exchange(failing_, false))
    SPDLOG_INFO("audit file {}: can be written again; {} entries are not in it", file_, lost_);
  if (waiting_.size() <= kMostWaiting) return;
  waiting_.pop_front();
  ++lost_;
}

// One call of the system for each line, so that none is torn by another program's. Not blocked by a pipe that
// nobody reads.
Result<void> AuditLog::Append(const std::string& line) const {
  std::error_code error;
  const auto size = fs::file_size(file_, error);
  if (!error && size > 0 && size + line.size() > max_bytes_) {
    fs::rename(file_, file_ + ".1", error);
    if (error) return Error{ErrorCode::kUnavailable, error.message()};
  }
  fs::create_directories(fs::path(file_).parent_path(), error);
  const auto failed = [] { return Error{ErrorCode::kUnavailable, std::generic_category().message(errno)}; };
  const int file = ::open(file_.c_str(), O_WRONLY | O_APPEND | O_CREAT | O_CLOEXEC | O_NONBLOCK, 0640);
  if (file < 0) return failed();
  struct stat status{};
  Result<void> out;
  if (::fstat(file, &status) != 0 || !S_ISREG(status.st_mode)) {
    out = Error{ErrorCode::kFailedPrecondition, "is no regular file"};
  } else if (const ssize_t written = ::write(file, line.data(), line.size());
             written != static_cast<ssize_t>(line.size())) {
    out = written < 0 ? failed() : Error{ErrorCode::kResourceExhausted, "no space for a whole line"};
    if (written > 0 && ::ftruncate(file, status.st_size) != 0)
      out = failed();  // not half of it, and then all
  }
  ::close(file);
  return out;
}

}  // namespace taclink::server
