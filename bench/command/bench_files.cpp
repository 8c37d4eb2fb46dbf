#include "bench/command/bench_files.h"

#include <fstream>
#include <sstream>
#include <utility>

#include "sensing/model/model_file.h"

namespace taclink::command {
Result<std::vector<LinkModel>> LoadBenchModels(const std::string& name) {
  const std::vector<std::string> names =
      name == "all" ? std::vector<std::string>{"cylinder", "barrel"} : std::vector<std::string>{name};
  std::vector<LinkModel> models;
  for (const std::string& one : names) {
    auto model = LoadLinkModel(one);
    if (!model) return model.error();
    models.push_back(std::move(*model));
  }
  return models;
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

Result<Scratch> Scratch::Make(const std::string& parent) {
  const std::filesystem::path folder =
      parent.empty() ? std::filesystem::temp_directory_path() : std::filesystem::path(parent);
  std::string name = (folder / "taclink-bench-XXXXXX").string();
  if (!mkdtemp(name.data())) return Error{ErrorCode::kUnavailable, name + ": no folder could be made"};
  return Scratch{name};
}

Scratch::~Scratch() {
  std::error_code ignored;
  if (!path.empty()) std::filesystem::remove_all(path, ignored);
}

}  // namespace taclink::command
