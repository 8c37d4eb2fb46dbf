#include "client/command/cli/output_files.h"

#include <fstream>

namespace taclink::command {
namespace {

Error NotWritable(const std::string& path) {
  return {ErrorCode::kUnavailable, path + ": cannot be written; check the folder and the disk"};
}

}  // namespace

Result<void> CheckWritable(const std::vector<std::string>& paths) {
  for (const std::string& path : paths) {
    if (!path.empty() && !std::ofstream(path, std::ios::app)) return NotWritable(path);
  }
  return {};
}

Result<void> WriteText(const std::string& path, const std::string& text) {
  if (path.empty()) return {};
  std::ofstream file(path, std::ios::trunc);
  file << text;
  file.close();
  if (!file) return NotWritable(path);
  return {};
}

}  // namespace taclink::command
