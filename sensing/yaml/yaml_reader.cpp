#include "sensing/yaml/yaml_reader.h"

#include <yaml-cpp/eventhandler.h>

#include <algorithm>
#include <cmath>
#include <fstream>
#include <sstream>
#include <type_traits>
#include <utility>

#include "sensing/core/read_file.h"

namespace taclink {
namespace {

constexpr int kMostDepth = 100;        // of lists and mappings
constexpr size_t kMostProblems = 100;  // a file of another kind would fill the screen

// Lines count from 1; nodes that are not from the file have none.
int LineOf(const YAML::Node& node, int otherwise) {
  return node.IsDefined() && node.Mark().line >= 0 ? node.Mark().line + 1 : otherwise;
}

// Of an empty value the parser tells where the next one begins.
int KeyLine(const YAML::Node& map, const std::string& key, int otherwise) {
  if (!map.IsMap()) return otherwise;
  for (const auto& entry : map)
    if (entry.first.IsScalar() && entry.first.Scalar() == key) return LineOf(entry.first, otherwise);
  return otherwise;
}

std::string Quoted(const std::vector<std::string_view>& choices) {
  std::string text;
  for (const auto choice : choices) text += (text.empty() ? "" : ", ") + std::string(choice);
  return text;
}

std::string Shown(double value) {
  std::ostringstream out;
  out << value;
  return out.str();
}

bool IsControl(char c) {
  return static_cast<unsigned char>(c) < ' ' || c == '\x7f';
}

// After a failure readers go on to the end: with numbers that they can count with.
int Within(Range range, int value) {
  return static_cast<int>(std::clamp<double>(value, range.min, range.max));
}
double Within(Range range, double value) {
  return std::isfinite(value) ? std::clamp(value, range.min, range.max) : 0;
}

// Of a stream, without making nodes of them. The parser recurses into what is nested, and so does what works
// on its nodes: it is stopped here, before there are any.
class DocumentCounter final : public YAML::EventHandler {
 public:
  int count() const { return count_; }

 private:
  void OnDocumentStart(const YAML::Mark&) override { ++count_; }
  void OnDocumentEnd() override {}
  void OnNull(const YAML::Mark&, YAML::anchor_t) override {}
  void OnAlias(const YAML::Mark&, YAML::anchor_t) override {}
  void OnScalar(const YAML::Mark&, const std::string&, YAML::anchor_t, const std::string&) override {}
  void OnSequenceStart(const YAML::Mark& mark, const std::string&, YAML::anchor_t,
                       YAML::EmitterStyle::value) override {
    Enter(mark);
  }
  void OnSequenceEnd() override { --depth_; }
  void OnMapStart(const YAML::Mark& mark, const std::string&, YAML::anchor_t,
                  YAML::EmitterStyle::value) override {
    Enter(mark);
  }
  void OnMapEnd() override { --depth_; }
  void Enter(const YAML::Mark& mark) {
    if (++depth_ > kMostDepth)
      throw YAML::ParserException(mark, "lists and mappings are nested to a depth of more than " +
                                            std::to_string(kMostDepth) + ", the most that is read");
  }

  int count_ = 0;
  int depth_ = 0;
};

int CountDocuments(std::string_view content) {
  std::istringstream in{std::string(content)};
  YAML::Parser parser(in);
  DocumentCounter counter;
  while (counter.count() < 2 && parser.HandleNextDocument(counter)) {
  }
  return counter.count();
}

}  // namespace

YamlMap::YamlMap(std::shared_ptr<Context> context, const YAML::Node& node, std::string path, int line)
    : context_(std::move(context)), node_(node), path_(std::move(path)), line_(LineOf(node_, line)) {
  if (!node_.IsMap()) return;
  std::set<std::string> keys;  // the parser would take one of two and say nothing
  for (const auto& entry : node_) {
    if (entry.first.IsScalar() && !keys.insert(entry.first.Scalar()).second)
      FailAt(entry.first, entry.first.Scalar(), "stands here a second time");
  }
}

bool YamlMap::Has(const std::string& key) const {
  return node_.IsMap() && node_[key].IsDefined();
}

bool YamlMap::Knows(const std::string& key) {
  asked_.insert(key);
  return Has(key);
}

YAML::Node YamlMap::Find(const std::string& key, bool required) {
  asked_.insert(key);
  if (node_.IsMap()) {
    const YAML::Node found = node_[key];
    if (found.IsDefined()) return found;
  }
  if (required) FailAt(node_, key, "is missing", true);
  return YAML::Node(YAML::NodeType::Undefined);
}

bool YamlMap::Ask(const std::string& key, bool required) {
  return Find(key, required).IsDefined();
}

bool YamlMap::Failed(const std::string& key) const {
  if (context_->left_out > 0) return true;  // it may be among those that are not kept
  const std::string path = path_ + key;
  return std::ranges::any_of(context_->problems, [&](const Problem& problem) {
    const std::string full = problem.map + problem.key;
    const bool is_below = full.starts_with(path) && (full.size() == path.size() || full[path.size()] == '.' ||
                                                     full[path.size()] == '[');
    return is_below || (!absent_.empty() && full == absent_);
  });
}

void YamlMap::FailAt(const YAML::Node& node, const std::string& key, const std::string& what,
                     bool is_missing_key) {
  const bool is_empty = node.IsDefined() && node.IsNull();
  const int line = is_empty ? KeyLine(node_, key, line_) : LineOf(node, line_);
  // Of a mapping that is missing as a whole only that is reported.
  const std::string map = is_missing_key && !absent_.empty() ? "" : path_;
  const std::string& name = is_missing_key && !absent_.empty() ? absent_ : key;
  const auto is_known = [&](const Problem& problem) {
    return problem.line == line && problem.key == name && problem.map == map;
  };
  std::vector<Problem>& problems = context_->problems;
  if (std::ranges::any_of(problems, is_known)) return;
  if (problems.size() == kMostProblems) {
    ++context_->left_out;
    return;
  }
  std::string message = context_->file + ":" + std::to_string(line) + ": '" + map + name + "' " + what;
  std::replace_if(message.begin(), message.end(), IsControl, ' ');  // a message is one line
  problems.push_back({.line = line,
                      .order = line,
                      .is_missing_key = is_missing_key,
                      .map = map,
                      .key = name,
                      .message = std::move(message)});
}

void YamlMap::Fail(const std::string& key, const std::string& what,
                   std::initializer_list<const char*> others) {
  const auto explains = [&](const Problem& problem) {
    return (problem.map == path_ && problem.key == key) ||
           (!absent_.empty() && problem.map + problem.key == absent_);
  };
  if (std::ranges::any_of(context_->problems, explains)) return;
  if (std::ranges::any_of(others, [this](const char* other) { return Failed(other); })) return;
  FailAt(Has(key) ? node_[key] : node_, key, what);
}

std::string YamlMap::Where() const {
  return context_->file + ":" + std::to_string(line_);
}

template <typename T>
T YamlMap::Scalar(const std::string& key, const YAML::Node& node, const char* expected) {
  if (!node.IsDefined()) return {};
  T value{};
  if (node.IsScalar() && YAML::convert<T>::decode(node, value)) {
    if constexpr (std::is_same_v<T, std::string>) {
      if (std::any_of(value.begin(), value.end(), IsControl)) {
        FailAt(node, key,
               "must be on one line, without control characters (is a quote or a bracket missing?)");
        return {};
      }
    }
    return value;
  }
  FailAt(node, key,
         std::string("must be ") + expected + (node.IsScalar() ? ", not '" + node.Scalar() + "'" : ""));
  return {};
}

double YamlMap::CheckRange(const std::string& key, double value, Range range, const YAML::Node& node) {
  if (std::isfinite(value) && value >= range.min && value <= range.max) return value;
  std::string expected = "must be a finite number";
  if (range.min == kPositive.min) {
    expected = "must be greater than 0";
  } else if (std::isfinite(range.min)) {
    expected = "must be at least " + Shown(range.min);
  }
  if (std::isfinite(range.max))
    expected += std::string(std::isfinite(range.min) ? " and" : "") + " at most " + Shown(range.max);
  FailAt(node, key, expected + ", not " + Shown(value));
  return value;
}

double YamlMap::Number(const std::string& key, Range range) {
  const YAML::Node node = Find(key, true);
  const double value = Scalar<double>(key, node, "a number");
  return node.IsDefined() ? CheckRange(key, value, range, node) : value;
}

double YamlMap::Number(const std::string& key, double fallback, Range range) {
  asked_.insert(key);
  return Has(key) ? Number(key, range) : fallback;
}

int YamlMap::Integer(const std::string& key, Range range) {
  const YAML::Node node = Find(key, true);
  const int value = Scalar<int>(key, node, "a whole number");
  if (node.IsDefined()) CheckRange(key, value, range, node);
  return Within(range, value);
}

int YamlMap::Integer(const std::string& key, int fallback, Range range) {
  asked_.insert(key);
  return Has(key) ? Integer(key, range) : fallback;
}

bool YamlMap::Bool(const std::string& key, bool fallback) {
  const YAML::Node node = Find(key, false);
  return node.IsDefined() ? Scalar<bool>(key, node, "true or false") : fallback;
}

std::string YamlMap::Text(const std::string& key) {
  return Scalar<std::string>(key, Find(key, true), "a text");
}

std::string YamlMap::Text(const std::string& key, std::string fallback) {
  asked_.insert(key);
  return Has(key) ? Text(key) : std::move(fallback);
}

std::string YamlMap::Prose(const std::string& key, std::string fallback) {
  const YAML::Node node = Find(key, false);
  if (!node.IsDefined()) return fallback;
  std::string text;
  if (!node.IsScalar() || !YAML::convert<std::string>::decode(node, text))
    FailAt(node, key, "must be a text");
  std::replace_if(text.begin(), text.end(), IsControl, ' ');
  text.erase(text.find_last_not_of(' ') + 1);
  return text;
}

size_t YamlMap::Choice(const std::string& key, const std::vector<std::string_view>& choices) {
  const std::string text = Text(key);
  for (size_t i = 0; i < choices.size(); ++i) {
    if (text == choices[i]) return i;
  }
  Fail(key, "must be one of " + Quoted(choices) + ", not '" + text + "'");
  return 0;
}

size_t YamlMap::Choice(const std::string& key, const std::vector<std::string_view>& choices,
                       size_t fallback) {
  asked_.insert(key);
  return Has(key) ? Choice(key, choices) : fallback;
}

template <typename T>
std::vector<T> YamlMap::List(const std::string& key, size_t count, Range range, const std::string& expected) {
  const YAML::Node node = Find(key, true);
  std::vector<T> values;
  if (!node.IsDefined()) return std::vector<T>(count);
  if (node.IsSequence() && (count == 0 || node.size() == count)) {
    for (const auto& item : node) {
      const T value = Scalar<T>(key, item, expected.c_str());
      CheckRange(key, value, range, item);
      values.push_back(Within(range, value));
    }
  } else {
    FailAt(node, key, "must be a list of " + (count == 0 ? "" : std::to_string(count) + " ") + expected);
    values.assign(count, T());
  }
  return values;
}

std::vector<double> YamlMap::Numbers(const std::string& key, size_t count, Range range) {
  return List<double>(key, count, range, "numbers");
}

std::vector<int> YamlMap::Integers(const std::string& key, size_t count, Range range) {
  return List<int>(key, count, range, "whole numbers");
}

std::vector<std::string> YamlMap::Texts(const std::string& key) {
  const YAML::Node node = Find(key, true);
  std::vector<std::string> values;
  if (!node.IsDefined()) return values;
  if (!node.IsSequence()) FailAt(node, key, "must be a list of texts");
  for (const auto& item : node) values.push_back(Scalar<std::string>(key, item, "texts"));
  return values;
}

YamlMap YamlMap::Map(const std::string& key, const char* scalar_for) {
  YAML::Node node = Find(key, false);
  const bool is_absent = !node.IsDefined();
  if (scalar_for != nullptr && node.IsDefined() && node.IsScalar()) {
    YAML::Node map(YAML::NodeType::Map);
    map[scalar_for] = node;
    node.reset(map);  // not an assignment, which would change the document
  }
  if (!node.IsDefined() || node.IsNull()) {
    node.reset(YAML::Node(YAML::NodeType::Map));
  } else if (!node.IsMap()) {
    FailAt(node, key, "must be a mapping (key: value)");
    node.reset(YAML::Node(YAML::NodeType::Map));
  }
  YamlMap map(context_, node, path_ + key + ".", KeyLine(node_, key, line_));
  if (is_absent) map.absent_ = absent_.empty() ? path_ + key : absent_;
  return map;
}

std::vector<YamlMap> YamlMap::Maps(const std::string& key) {
  const YAML::Node node = Find(key, false);
  std::vector<YamlMap> maps;
  if (!node.IsDefined() || node.IsNull()) return maps;
  if (!node.IsSequence()) {
    FailAt(node, key, "must be a list");
    return maps;
  }
  for (const auto& item : node) {
    if (item.IsMap()) {
      maps.push_back(YamlMap(context_, item, path_ + key + "[" + std::to_string(maps.size()) + "].", line_));
    } else {
      FailAt(item, key, "must be a list of mappings (key: value)");
    }
  }
  return maps;
}

void YamlMap::Done() {
  if (!node_.IsMap() || abandoned_) return;
  std::string known;
  for (const auto& name : asked_) known += (known.empty() ? "" : ", ") + name;
  int first_line = 0;
  for (const auto& entry : node_) {
    const auto key = entry.first.IsScalar() ? entry.first.Scalar() : std::string("?");
    if (asked_.contains(key)) continue;
    FailAt(entry.first, key, "is not a known key here" + (first_line > 0 ? "" : "; known are: " + known));
    if (first_line == 0) first_line = LineOf(entry.first, line_);
  }
  for (Problem& problem : context_->problems)
    if (problem.is_missing_key && problem.map == path_) problem.order = std::max(problem.order, first_line);
}

void YamlMap::Abandon() {
  abandoned_ = true;
}

Result<YamlFile> YamlFile::Load(const std::string& path) {
  const auto content = ReadFile(path);
  if (!content) return content.error();
  return Parse(path, *content);
}

Result<YamlFile> YamlFile::Parse(const std::string& name, std::string_view content) {
  try {
    if (content.size() > kMostTextBytes)
      return Error{ErrorCode::kInvalidArgument, name + ": has " + std::to_string(content.size()) +
                                                    " bytes; at most " + std::to_string(kMostTextBytes) +
                                                    " are read"};
    if (CountDocuments(content) > 1)
      return Error{ErrorCode::kInvalidArgument, name + ": holds more than one document, separated by '---'"};
    const YAML::Node node = YAML::Load(std::string(content));
    if (!node.IsMap()) {
      return Error{ErrorCode::kInvalidArgument, name + ":1: must be a mapping (key: value) at the top"};
    }
    auto context = std::make_shared<YamlMap::Context>();
    context->file = name;
    return YamlFile(YamlMap(std::move(context), node, "", 1));
  } catch (const YAML::Exception& e) {
    return Error{ErrorCode::kInvalidArgument, name + ":" + std::to_string(e.mark.line + 1) + ": " + e.msg};
  }
}

Result<void> YamlFile::Finish() {
  const YamlMap::Context& context = *root_.context_;
  if (context.problems.empty()) return {};
  std::vector<YamlMap::Problem> problems = context.problems;
  std::ranges::stable_sort(problems, {}, [](const YamlMap::Problem& problem) {
    return std::pair(problem.order, problem.is_missing_key);
  });
  std::string text;
  for (const YamlMap::Problem& problem : problems) text += (text.empty() ? "" : "\n") + problem.message;
  if (context.left_out > 0)
    text += "\n" + context.file + ": has " + std::to_string(context.left_out) + " more errors";
  return Error{ErrorCode::kInvalidArgument, std::move(text)};
}

}  // namespace taclink
