#include <algorithm>
#include <filesystem>

#include "sensing/yaml/fields.h"
#include "sensing/yaml/yaml_reader.h"

namespace taclink {
namespace {

class FieldReader final : public FieldVisitor {
 public:
  /// `only_asks`: keys become known ones, and nothing is read.
  FieldReader(YamlMap& map, const std::string& folder, bool only_asks = false)
      : map_(map), folder_(folder), only_asks_(only_asks) {}

  void Fail(const char* key, const std::string& what, std::initializer_list<const char*> others) override {
    if (!only_asks_) map_.Fail(key, what, others);
  }
  bool Wants(const Key& key, bool /*is_given*/) override {
    return map_.Ask(key.name, key.required && !only_asks_) && !only_asks_;
  }
  size_t Count(const char* key, size_t /*given*/) override { return map_.Maps(key).size(); }

 private:
  // `read` returns the value; it is taken if it is a good one.
  template <typename T, typename Read>
  void Take(const Key& key, T& value, const Read& read) {
    if (!Wants(key, true)) return;
    T got = read();
    if (!map_.Failed(key.name)) value = std::move(got);
  }
  std::string Resolved(const std::string& path) const {
    return (std::filesystem::path(folder_) / path).lexically_normal().string();
  }

  void Bool(const Key& key, bool& value) override {
    Take(key, value, [&] { return map_.Bool(key.name, value); });
  }
  void Integer(const Key& key, int& value, Range range) override {
    Take(key, value, [&] { return map_.Integer(key.name, range); });
  }
  void Number(const Key& key, double& value, Range range) override {
    Take(key, value, [&] { return map_.Number(key.name, range); });
  }
  void OneOf(const Key& key, size_t& index, const Names& names) override {
    Take(key, index, [&] { return map_.Choice(key.name, names); });
  }
  void Text(const Key& key, std::string& value, TextKind kind) override {
    Take(key, value, [&] {
      std::string text = map_.Text(key.name);
      if (kind == TextKind::kText) return text;
      if (text.empty()) {
        if (key.required) map_.Fail(key.name, "must be a path");
        return text;
      }
      const bool is_path = kind == TextKind::kPath || text.find('/') != std::string::npos ||
                           text.ends_with(".yaml") || text.ends_with(".yml");
      return is_path ? Resolved(text) : text;
    });
  }
  void Numbers(const Key& key, std::span<double> values, Range range) override {
    if (!Wants(key, true)) return;
    const auto got = map_.Numbers(key.name, values.size(), range);
    if (!map_.Failed(key.name)) std::ranges::copy(got, values.begin());
  }
  void Integers(const Key& key, std::vector<int>& values, size_t count, Range range) override {
    Take(key, values, [&] { return map_.Integers(key.name, count, range); });
  }
  void Texts(const Key& key, std::span<std::string> values, const char* items) override {
    if (!Wants(key, true)) return;
    const auto got = map_.Texts(key.name);
    if (got.size() != values.size()) {
      map_.Fail(key.name, std::string("must be a list of ") + items);
    } else if (!map_.Failed(key.name)) {
      std::ranges::copy(got, values.begin());
    }
  }
  void Section(const Key& key, const Fields& fields) override {
    if (!Wants(key, true)) return;
    YamlMap map = map_.Map(key.name, key.scalar_for);
    ReadFields(map, folder_, fields);
  }
  void Maps(const Key& key, size_t /*count*/,
            const std::function<void(size_t, FieldVisitor&)>& fields) override {
    if (!map_.Ask(key.name, false) || only_asks_) return;  // a list that must not be empty has a Check
    size_t index = 0;
    for (YamlMap& map : map_.Maps(key.name)) {
      ReadFields(map, folder_, [&](FieldVisitor& visit) { fields(index, visit); });
      ++index;
    }
  }
  void Alternatives(const Key& key, size_t index, const Names& names,
                    const std::function<void(size_t, FieldVisitor&)>& fields) override {
    OneOf(key, index, names);
    if (!only_asks_ && !map_.Failed(key.name)) return fields(index, *this);
    FieldReader asker(map_, folder_, true);
    for (size_t i = 0; i < names.size(); ++i) fields(i, asker);
  }

  YamlMap& map_;
  const std::string& folder_;
  const bool only_asks_;
};

}  // namespace

void ReadFields(YamlMap& map, const std::string& folder, const FieldVisitor::Fields& fields) {
  FieldReader reader(map, folder);
  fields(reader);
  map.Done();
}

}  // namespace taclink
