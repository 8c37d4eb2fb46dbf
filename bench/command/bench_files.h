#pragma once

#include <filesystem>
#include <string>
#include <utility>
#include <vector>

#include "client/command/cli/output_files.h"
#include "sensing/core/link_model.h"
#include "sensing/core/result.h"

namespace taclink::command {

/// A shipped model's name, a file, or "all": the shipped ones.
Result<std::vector<LinkModel>> LoadBenchModels(const std::string& name);

/// Between the marks "<!-- begin: COMMAND -->" and "<!-- end -->" of a page, if there are any; else the file
/// holds the text alone.
Result<void> WriteBetweenMarks(const std::string& path, const std::string& command, const std::string& text);

/// A folder of this program's own, gone with this object.
struct Scratch {
  std::filesystem::path path;

  /// In `parent`; empty: where temporary files go. Errors: kUnavailable.
  static Result<Scratch> Make(const std::string& parent);
  explicit Scratch(std::filesystem::path folder) : path(std::move(folder)) {}
  Scratch(Scratch&& other) noexcept : path(std::exchange(other.path, {})) {}
  Scratch& operator=(Scratch&&) = delete;
  ~Scratch();
};

}  // namespace taclink::command
