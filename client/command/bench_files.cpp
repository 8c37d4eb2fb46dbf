#include "client/command/bench_files.h"

#include <fstream>
#include <sstream>

namespace taclink::command {

Result<void> WriteText(const std::string& path, const std::string& text) {
  if (path.empty()) return {};
  std::ofstream file(path, std::ios::trunc);
  file << text;
  file.close();
  if (!file)
    return Error{ErrorCode::kUnavailable, path + ": cannot be written; check the folder and the disk"};
  return {};
}

Result<void> WriteBetweenMarks(const std::string& path, const std::string& command, const std::string& text) {
  if (path.empty()) return {};
  const std::string begin = "<!-- begin: " + command + " -->\n", end = "<!-- end -->";
  std::ostringstream before;
  if (const std::ifstream file(path); file) before << file.rdbuf();
  const std::string page = before.str();
  const size_t from = page.find(begin), to = page.find(end, from == std::string::npos ? 0 : from);
  if (from == std::string::npos || to == std::string::npos) return WriteText(path, text);
  return WriteText(path, page.substr(0, from) + begin + "\n" + text + page.substr(to));
}

}  // namespace taclink::command
