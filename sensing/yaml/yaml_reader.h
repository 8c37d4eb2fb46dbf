#pragma once

#include <yaml-cpp/yaml.h>

#include <cstddef>
#include <initializer_list>
#include <memory>
#include <set>
#include <string>
#include <string_view>
#include <vector>

#include "sensing/core/result.h"
#include "sensing/yaml/range.h"

namespace taclink {

/// Reads one mapping of a YAML file strictly. A getter that fails records an error with file, line and what
/// was expected, and returns a default, so that a reader is a plain list of fields; `Done` then reports keys
/// that nobody asked for. A key that appears twice is an error as well. The file keeps all errors, at most
/// one for each line of a key: what follows from a value that could not be read is not reported.
/// YamlFile::Finish returns them.
class YamlMap {
 public:
  bool Has(const std::string& key) const;
  /// Has(key); either way the key is a known one.
  bool Knows(const std::string& key);
  /// Has(key); the key becomes a known one, and an error is recorded if it is required and missing.
  bool Ask(const std::string& key, bool required);
  /// Whether an error was recorded for the key of this mapping, or for one below it.
  bool Failed(const std::string& key) const;

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
  /// A mapping; an empty one where the key is missing. With `scalar_for`, a single value in place of the
  /// mapping is a mapping of that one key.
  YamlMap Map(const std::string& key, const char* scalar_for = nullptr);
  /// Every mapping of a list; none where the key is missing.
  std::vector<YamlMap> Maps(const std::string& key);

  /// All unknown keys become errors. Call once everything was read.
  void Done();
  /// In place of Done, where a value decides which keys are known and could not be read.
  void Abandon();
  /// Records an error at `key`'s line (or the map's, where there is no such key), unless it has one already,
  /// or one of `others`, on which the statement depends as well, has one.
  void Fail(const std::string& key, const std::string& what, std::initializer_list<const char*> others = {});
  /// Where this mapping stands: "file:line".
  std::string Where() const;

 private:
  friend class YamlFile;
  struct Problem {
    int line = 0;
    int order = 0;  // line that it is sorted by
    bool is_missing_key = false;
    std::string map, key;
    std::string message;
  };
  struct Context {
    std::string file;
    std::vector<Problem> problems;
    size_t left_out = 0;  // problems beyond the most that are kept
  };
  YamlMap(std::shared_ptr<Context> context, const YAML::Node& node, std::string path, int line);

  YAML::Node Find(const std::string& key, bool required);
  template <typename T>
  T Scalar(const std::string& key, const YAML::Node& node, const char* expected);
  template <typename T>
  std::vector<T> List(const std::string& key, size_t count, Range range, const std::string& expected);
  double CheckRange(const std::string& key, double value, Range range, const YAML::Node& node);
  void FailAt(const YAML::Node& node, const std::string& key, const std::string& what,
              bool is_missing_key = false);

  std::shared_ptr<Context> context_;
  YAML::Node node_;
  std::string path_;
  int line_;            // of the mapping, or of the one it is missing from
  std::string absent_;  // path of the outermost mapping that is missing and holds this one, or is it
  std::set<std::string> asked_;
  bool abandoned_ = false;
};

/// A YAML file whose root is a mapping.
class YamlFile {
 public:
  /// Errors: kNotFound, kInvalidArgument (syntax, with file and line).
  static Result<YamlFile> Load(const std::string& path);
  /// `name` stands in for the path in messages.
  static Result<YamlFile> Parse(const std::string& name, std::string_view content);

  YamlMap& root() { return root_; }
  /// All errors recorded by any map of this file, one a line, in the order of the file. An unknown key comes
  /// before the missing ones of its mapping, because a misspelled key explains a missing one.
  Result<void> Finish();

 private:
  explicit YamlFile(YamlMap root) : root_(std::move(root)) {}
  YamlMap root_;
};

}  // namespace taclink
