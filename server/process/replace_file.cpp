#include "server/process/replace_file.h"

#include <fcntl.h>
#include <unistd.h>

#include <cerrno>
#include <filesystem>
#include <system_error>

namespace taclink::server {
namespace {

namespace fs = std::filesystem;

// The error of the last call.
Error Failure(const std::string& path) {
  return {ErrorCode::kUnavailable,
          "cannot write " + path + ": " + std::error_code(errno, std::generic_category()).message()};
}

Result<void> WriteAll(int file, const std::string& path, std::string_view content) {
  while (!content.empty()) {
    const ssize_t written = ::write(file, content.data(), content.size());
    if (written < 0 && errno == EINTR) continue;
    if (written < 0) return Failure(path);
    content.remove_prefix(static_cast<size_t>(written));
  }
  if (::fsync(file) != 0) return Failure(path);
  return {};
}

}  // namespace

Result<void> ReplaceFile(const std::string& path, std::string_view content) {
  const std::string folder = fs::path(path).parent_path().string(), fresh = path + ".new";
  std::error_code error;
  if (!folder.empty()) fs::create_directories(folder, error);
  if (error) return Error{ErrorCode::kUnavailable, "cannot make " + folder + ": " + error.message()};
  const int file = ::open(fresh.c_str(), O_CREAT | O_TRUNC | O_WRONLY | O_CLOEXEC, 0640);
  if (file < 0) return Failure(fresh);
  auto written = WriteAll(file, fresh, content);
  if (::close(file) != 0 && written) written = Failure(fresh);
  if (written && ::rename(fresh.c_str(), path.c_str()) != 0) written = Failure(path);
  if (!written) {
    ::unlink(fresh.c_str());
    return written;
  }
  const int above = ::open(folder.empty() ? "." : folder.c_str(), O_RDONLY | O_DIRECTORY | O_CLOEXEC);
  if (above < 0) return Failure(path);
  const bool synced = ::fsync(above) == 0;
  const auto failure = Failure(path);
  ::close(above);
  if (!synced) return failure;
  return {};
}

}  // namespace taclink::server
