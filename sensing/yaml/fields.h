#pragma once

#include <algorithm>
#include <array>
#include <chrono>
#include <cmath>
#include <cstddef>
#include <functional>
#include <initializer_list>
#include <optional>
#include <span>
#include <string>
#include <string_view>
#include <type_traits>
#include <utility>
#include <variant>
#include <vector>

#include "sensing/core/result.h"
#include "sensing/yaml/range.h"

namespace taclink {

/// A key of a mapping as its section declares it. The unit is the key's suffix (`_n`, `_mm`, `_hz`), the
/// default is the value of a fresh section.
struct Key {
  Key(const char* key) : name(key) {}  // NOLINT(google-explicit-constructor)
  const char* name;
  const char* help = "";
  bool required = false;
  bool has_default = true;           ///< false: no value, or one that the machine or another key decides
  const char* scalar_for = nullptr;  ///< a single value in place of the mapping is that key's
};
inline Key Required(Key key) {
  key.required = true;
  return key;
}
inline Key NoDefault(Key key) {
  key.has_default = false;
  return key;
}
inline Key Shorthand(Key key, const char* scalar_for) {
  key.scalar_for = scalar_for;
  return key;
}

using Names = std::vector<std::string_view>;  ///< of the values of a choice
using TextCheck = std::function<Result<void>(const std::string&)>;
enum class TextKind {
  kText,
  kPath,        ///< relative to the folder of the file
  kNameOrPath,  ///< a path, or a bare word that names a shipped file
};

/// Visits the keys of a section of a YAML file in their order. A section is a struct whose function
/// `void Describe(FieldVisitor& visit)` calls the visitor once for each key:
///
///     visit("end_n", end_n, {0.001, 1000}, "A contact ends below this force.");
///     visit.Check(end_n <= begin_n, "end_n", "must not be above begin_n", {"begin_n"});
///
/// Reading (ReadFields), writing (FieldsText), the JSON schema (FieldsSchema) and the reference page
/// (FieldsReference) are visitors.
class FieldVisitor {
 public:
  using Fields = std::function<void(FieldVisitor&)>;

  virtual ~FieldVisitor() = default;

  void operator()(Key key, bool& value, const char* help) { Bool(With(key, help), value); }
  void operator()(Key key, int& value, Range range, const char* help) {
    Integer(With(key, help), value, range);
  }
  void operator()(Key key, double& value, Range range, const char* help) {
    Number(With(key, help), value, range);
  }
  void operator()(Key key, std::chrono::milliseconds& value, Range seconds, const char* help) {
    double value_s = 1e-3 * static_cast<double>(value.count());
    Number(With(key, help), value_s, seconds);
    value = std::chrono::milliseconds(std::llround(1e3 * value_s));
  }
  void operator()(Key key, std::string& value, const char* help, const TextCheck& check = {}) {
    Text(With(key, help), value, TextKind::kText);
    if (!check) return;
    if (const auto good = check(value); !good) Fail(key.name, good.error().message);
  }
  template <size_t N>
  void operator()(Key key, std::array<double, N>& values, Range range, const char* help) {
    Numbers(With(key, help), values, range);
  }
  template <size_t N>
  void operator()(Key key, std::array<int, N>& values, Range range, const char* help) {
    std::vector<int> list(values.begin(), values.end());
    Integers(With(key, help), list, N, range);
    std::copy_n(list.begin(), N, values.begin());
  }
  void operator()(Key key, std::vector<int>& values, Range range, const char* help) {
    Integers(With(key, help), values, 0, range);
  }
  /// `items`: what the list must be of, for the message.
  template <size_t N>
  void operator()(Key key, std::array<std::string, N>& values, const char* items, const char* help) {
    Texts(With(key, help), values, items);
  }
  /// None: the key is not there. `more`: as for T itself.
  template <typename T>
  void operator()(Key key, std::optional<T>& value, Range range, const char* help) {
    Optional(key, value, [&](T& inner) { (*this)(NoDefault(key), inner, range, help); });
  }
  template <typename T, typename... More>
  void operator()(Key key, std::optional<T>& value, const char* help, const More&... more) {
    Optional(key, value, [&](T& inner) { (*this)(NoDefault(key), inner, help, more...); });
  }

  /// A mapping of its own.
  template <typename T>
    requires requires(T& section, FieldVisitor& fields) { section.Describe(fields); }
  void operator()(Key key, T& section, const char* help) {
    Map(key, help, [&](FieldVisitor& fields) { section.Describe(fields); });
  }
  /// A list of mappings with names of their own; each begins as `fresh`, and `noun` stands for one of them in
  /// messages. `check` (FieldVisitor&, T&) sees what was read of it.
  template <typename T, typename Check = void (*)(FieldVisitor&, T&)>
  void operator()(
      Key key, std::vector<T>& sections, const T& fresh, const char* noun, const char* help,
      const Check& check = [](FieldVisitor&, T&) {}) {
    Maps(With(key, help), sections.size(), [&](size_t index, FieldVisitor& fields) {
      if (index == sections.size()) sections.push_back(fresh);
      T& section = sections[index];
      section.Describe(fields);
      check(fields, section);
      const bool is_unique =
          std::all_of(sections.begin(), sections.begin() + static_cast<std::ptrdiff_t>(index),
                      [&](const T& other) { return other.name != section.name; });
      fields.Check(is_unique, "name", std::string("is used by another ") + noun);
    });
  }
  void Map(Key key, const char* help, const Fields& fields) { Section(With(key, help), fields); }

  void Path(Key key, std::string& value, const char* help) { Text(With(key, help), value, TextKind::kPath); }
  void Path(Key key, std::optional<std::string>& value, const char* help) {
    Optional(key, value, [&](std::string& path) {
      Path(NoDefault(key), path, help);
      Check(!path.empty(), key.name, "must be a path");
    });
  }
  void NameOrPath(Key key, std::string& value, const char* help) {
    Text(With(key, help), value, TextKind::kNameOrPath);
  }
  /// An enumeration, or two words for a bool; `names` in the order of its values, from 0.
  template <typename T>
  void Choice(Key key, T& value, const Names& names, const char* help) {
    auto index = static_cast<size_t>(value);
    OneOf(With(key, help), index, names);
    value = static_cast<T>(index);
  }
  void Choice(Key key, std::string& value, const Names& names, const char* help) {
    auto index = static_cast<size_t>(std::ranges::find(names, value) - names.begin());
    if (index == names.size()) index = 0;  // a value that no file can give
    OneOf(With(key, help), index, names);
    value = names[index];
  }
  /// None is the first of the names, `values` the others'.
  template <typename T, size_t N>
  void Choice(Key key, std::optional<T>& value, const Names& names, const T (&values)[N], const char* help) {
    size_t index = value ? static_cast<size_t>(std::ranges::find(values, *value) - values) + 1 : 0;
    OneOf(With(key, help), index, names);
    value = index == 0 ? std::nullopt : std::optional<T>(values[index - 1]);
  }
  /// The name of the alternative that `value` holds; its keys stand in the same mapping. `more`
  /// (FieldVisitor&, size_t alternative): keys that several alternatives have.
  template <typename... T, typename More = void (*)(FieldVisitor&, size_t)>
  void Variant(
      Key key, std::variant<T...>& value, const Names& names, const char* help,
      const More& more = [](FieldVisitor&, size_t) {}) {
    Alternatives(With(key, help), value.index(), names, [&](size_t index, FieldVisitor& fields) {
      if (index != value.index()) {
        size_t at = 0;
        static_cast<void>(((at++ == index ? (value.template emplace<T>(), true) : false) || ...));
      }
      std::visit(
          [&](auto& held) {
            if constexpr (requires { held.Describe(fields); }) held.Describe(fields);
          },
          value);
      more(fields, index);
    });
  }

  void Check(bool is_good, const char* key, const std::string& what,
             std::initializer_list<const char*> others = {}) {
    if (!is_good) Fail(key, what, others);
  }
  /// Of reading: an error at the key, unless it or one of `others` has one already.
  virtual void Fail(const char* /*key*/, const std::string& /*what*/,
                    std::initializer_list<const char*> /*others*/ = {}) {}
  /// Whether the key is visited: when reading, whether the file has it; when writing, `is_given`.
  virtual bool Wants(const Key& key, bool is_given) = 0;
  /// Of a list of mappings: when reading, the number of the file's.
  virtual size_t Count(const char* /*key*/, size_t given) { return given; }

 protected:
  virtual void Bool(const Key& key, bool& value) = 0;
  virtual void Integer(const Key& key, int& value, Range range) = 0;
  virtual void Number(const Key& key, double& value, Range range) = 0;
  virtual void Text(const Key& key, std::string& value, TextKind kind) = 0;
  virtual void OneOf(const Key& key, size_t& index, const Names& names) = 0;
  virtual void Numbers(const Key& key, std::span<double> values, Range range) = 0;
  virtual void Integers(const Key& key, std::vector<int>& values, size_t count, Range range) = 0;
  virtual void Texts(const Key& key, std::span<std::string> values, const char* items) = 0;
  virtual void Section(const Key& key, const Fields& fields) = 0;
  virtual void Maps(const Key& key, size_t count,
                    const std::function<void(size_t index, FieldVisitor&)>& fields) = 0;
  virtual void Alternatives(const Key& key, size_t index, const Names& names,
                            const std::function<void(size_t index, FieldVisitor&)>& fields) = 0;

 private:
  static Key With(Key key, const char* help) {
    key.help = help;
    return key;
  }
  template <typename T, typename Visit>
  void Optional(const Key& key, std::optional<T>& value, const Visit& visit) {
    if (!Wants(key, value.has_value())) return;
    T inner = value.value_or(T{});
    visit(inner);
    value = std::move(inner);
  }
};

/// For the functions below.
template <typename T>
FieldVisitor::Fields FieldsOf(T section) {
  return [section = std::move(section)](FieldVisitor& visit) mutable { section.Describe(visit); };
}
/// A file's whole content as YAML that reads back to the same.
std::string FieldsText(const FieldVisitor::Fields& fields);
/// As a JSON schema of draft 2020-12.
std::string FieldsSchema(const std::string& title, const FieldVisitor::Fields& fields);
/// As a page of Markdown: a table for every section.
std::string FieldsReference(const std::string& title, const std::string& introduction,
                            const FieldVisitor::Fields& fields);

class YamlMap;
/// Reads the mapping; a value that is not good stays as it was, and the file has an error. Relative paths
/// become relative to `folder`.
void ReadFields(YamlMap& map, const std::string& folder, const FieldVisitor::Fields& fields);

}  // namespace taclink
