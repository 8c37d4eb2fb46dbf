#pragma once

#include <yaml-cpp/yaml.h>

#include <functional>
#include <limits>
#include <memory>
#include <optional>
#include <set>
#include <string>
#include <string_view>
#include <vector>

#include "sensing/core/result.h"

namespace taclink {

/// Bounds of a number, inclusive.
struct Range {
  double min = -std::numeric_limits<double>::infinity();
  double max = std::numeric_limits<double>::infinity();
};
inline constexpr Range kPositive{.min = std::numeric_limits<double>::min()};
inline constexpr Range kNotNegative{.min = 0};

/// Reads one mapping of a YAML file strictly. A getter that fails records the error (the first one of the
/// file is kept, with file, line and what was expected) and returns a default, so that a reader is a plain
/// list of fields; `Done` then reports keys that nobody asked for. A key that stands twice is an error, too.
/// YamlFile::Finish says whether all went well.
class YamlMap {
 public:
  bool Has(const std::string& key) const;
  /// Whether a single value stands there, in place of a mapping or a list.
  bool HasScalar(const std::string& key) const;

  double Number(const std::string& key, Range range = {});
  double Number(const std::string& key, double fallback, Range range = {});
  int Integer(const std::string& key, Range range = {});
  int Integer(const std::string& key, int fallback, Range range = {});
  bool Bool(const std::string& key, bool fallback);
  /// On one line, without control characters: names and paths.
  std::string Text(const std::string& key);
  std::string Text(const std::string& key, std::string fallback);
  /// May be written on several lines; returned on one.
  std::string Prose(const std::string& key, std::string fallback);
  /// One of `choices`; returns its position.
  size_t Choice(const std::string& key, const std::vector<std::string_view>& choices);
  size_t Choice(const std::string& key, const std::vector<std::string_view>& choices, size_t fallback);
  /// A list of exactly `count` numbers (as many as there are if 0).
  std::vector<double> Numbers(const std::string& key, size_t count = 0, Range range = {});
  std::vector<int> Integers(const std::string& key, size_t count = 0, Range range = {});
  std::vector<std::string> Texts(const std::string& key);
  /// A mapping; an empty one where the key is missing.
  YamlMap Map(const std::string& key);
  /// Every mapping of a list; none where the key is missing.
  std::vector<YamlMap> Maps(const std::string& key);

  /// Unknown keys become errors. Call once everything was read.
  void Done();
  /// Records an error at `key`'s line (or the map's, where there is no such key).
  void Fail(const std::string& key, const std::string& what);
  /// Where this mapping stands: "file:line".
  std::string Where() const;

 private:
  friend class YamlFile;
  struct Context {
    std::string file;
    std::optional<Error> error;
    bool only_missing = false;  // the error is a missing key: a misspelt one explains more
  };
  YamlMap(std::shared_ptr<Context> context, const YAML::Node& node, std::string path, int line);

  YAML::Node Find(const std::string& key, bool required);
  template <typename T>
  T Scalar(const std::string& key, const YAML::Node& node, const char* expected);
  template <typename T>
  std::vector<T> List(const std::string& key, size_t count, Range range, const std::string& expected);
  double CheckRange(const std::string& key, double value, Range range);
  void FailAt(const YAML::Node& node, const std::string& key, const std::string& what);

  std::shared_ptr<Context> context_;
  YAML::Node node_;
  std::string path_;
  int line_;  // of the mapping, or of the one it is missing from
  std::set<std::string> asked_;
};

/// A YAML file whose root is a mapping.
class YamlFile {
 public:
  /// Errors: kNotFound, kInvalidArgument (syntax, with file and line).
  static Result<YamlFile> Load(const std::string& path);
  /// `name` stands in for the path in messages.
  static Result<YamlFile> Parse(const std::string& name, std::string_view content);

  YamlMap& root() { return root_; }
  /// The first error recorded by any map of this file, if any.
  Result<void> Finish();

 private:
  explicit YamlFile(YamlMap root) : root_(std::move(root)) {}
  YamlMap root_;
};

}  // namespace taclink
