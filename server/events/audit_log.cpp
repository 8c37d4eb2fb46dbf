#include "server/events/audit_log.h"

#include <spdlog/spdlog.h>

#include <ctime>
#include <filesystem>
#include <fstream>
#include <nlohmann/json.hpp>
#include <system_error>
#include <utility>

namespace taclink::server {
namespace {

using Json = nlohmann::ordered_json;

std::string UtcText(int64_t utc_ns) {
  const auto seconds = static_cast<std::time_t>(utc_ns / 1'000'000'000);
  std::tm utc{};
  gmtime_r(&seconds, &utc);
  char text[48];
  const size_t length = std::strftime(text, sizeof text, "%Y-%m-%dT%H:%M:%S", &utc);
  std::snprintf(text + length, sizeof text - length, ".%03dZ",
                static_cast<int>(utc_ns % 1'000'000'000 / 1'000'000));
  return text;
}

}  // namespace

std::string AuditLine(const Event& event, const std::string& link) {
  Json line = {{"time", UtcText(event.raised_utc_ns)}, {"what", Name(event.kind)}, {"link", link}};
  if (const auto* operation = std::get_if<Operation>(&event.detail)) {
    line["who"] = operation->who;
    line["accepted"] = operation->accepted;
    line["outcome"] = operation->outcome;
    line["values"] = Json(operation->values);
  } else if (const auto* drift = std::get_if<DriftDetail>(&event.detail)) {
    line["who"] = "server";
    line["values"] = {{"drift_m", drift->drift_mm * 1e-3}, {"step_m", drift->step_mm * 1e-3}};
  } else {
    return {};
  }
  // What clients send may be no text.
  return line.dump(-1, ' ', false, Json::error_handler_t::replace);
}

AuditLog::AuditLog(std::string file, size_t max_bytes) : file_(std::move(file)), max_bytes_(max_bytes) {}

void AuditLog::Write(const Event& event, const std::string& link) {
  if (file_.empty()) return;
  const std::string line = AuditLine(event, link);
  if (line.empty()) return;
  if (Append(line + "\n")) {
    if (std::exchange(failing_, false)) spdlog::info("audit file {}: can be written again", file_);
    return;
  }
  ++failures_;
  if (!std::exchange(failing_, true))
    spdlog::error("audit file {}: cannot be written; check the path, the rights and the disk", file_);
}

bool AuditLog::Append(const std::string& line) {
  std::error_code error;
  const auto size = std::filesystem::file_size(file_, error);
  if (!error && size > 0 && size + line.size() > max_bytes_) {
    std::filesystem::rename(file_, file_ + ".1", error);
    if (error) return false;
  }
  std::ofstream out(file_, std::ios::app);
  out << line << std::flush;
  return out.good();
}

}  // namespace taclink::server
