#include <nlohmann/json.hpp>

#include "sensing/yaml/fields_json.h"

namespace taclink {
namespace {

using Json = nlohmann::ordered_json;

// Numbers as they are written: 1, not 1.0.
Json NumberJson(double value) {
  const auto whole = static_cast<int64_t>(std::abs(value) < 1e15 ? value : 0.5);
  return static_cast<double>(whole) == value ? Json(whole) : Json(value);
}

void AddRange(Json& property, Range range) {
  if (range.min == kPositive.min) {
    property["exclusiveMinimum"] = 0;
  } else if (std::isfinite(range.min)) {
    property["minimum"] = NumberJson(range.min);
  }
  if (std::isfinite(range.max)) property["maximum"] = NumberJson(range.max);
}

Json EmptyObject() {
  return {{"type", "object"}, {"properties", Json::object()}};
}

class SchemaVisitor final : public FieldVisitor {
 public:
  explicit SchemaVisitor(Json& object) : object_(object) {}

  bool Wants(const Key& /*key*/, bool /*is_given*/) override { return true; }

 private:
  void Add(const Key& key, Json property, const Json& value = {}) {
    if (!value.is_null() && key.has_default && !key.required) property["default"] = value;
    property["description"] = key.help;
    object_["properties"][key.name] = std::move(property);
    if (key.required) object_["required"].push_back(key.name);
  }
  static Json Object(const Fields& fields) {
    Json object = EmptyObject();
    SchemaVisitor visit(object);
    fields(visit);
    object[object.contains("allOf") ? "unevaluatedProperties" : "additionalProperties"] = false;
    return object;
  }

  void Bool(const Key& key, bool& value) override { Add(key, {{"type", "boolean"}}, value); }
  void Integer(const Key& key, int& value, Range range) override {
    Json property = {{"type", "integer"}};
    AddRange(property, range);
    Add(key, std::move(property), value);
  }
  void Number(const Key& key, double& value, Range range) override {
    Json property = {{"type", "number"}};
    AddRange(property, range);
    Add(key, std::move(property), NumberJson(value));
  }
  void Text(const Key& key, std::string& value, TextKind /*kind*/) override {
    Add(key, {{"type", "string"}}, value);
  }
  void OneOf(const Key& key, size_t& index, const Names& names) override {
    Add(key, {{"type", "string"}, {"enum", names}}, index < names.size() ? Json(names[index]) : Json());
  }
  void List(const Key& key, Json item, size_t count, const Json& value) {
    Json property = {{"type", "array"}, {"items", std::move(item)}};
    if (count > 0) property["minItems"] = property["maxItems"] = count;
    Add(key, std::move(property), value);
  }
  void Numbers(const Key& key, std::span<double> values, Range range) override {
    Json item = {{"type", "number"}}, value = Json::array();
    AddRange(item, range);
    for (const double number : values) value.push_back(NumberJson(number));
    List(key, std::move(item), values.size(), value);
  }
  void Integers(const Key& key, std::vector<int>& values, size_t count, Range range) override {
    Json item = {{"type", "integer"}};
    AddRange(item, range);
    List(key, std::move(item), count, values);
  }
  void Texts(const Key& key, std::span<std::string> values, const char* /*items*/) override {
    List(key, {{"type", "string"}}, values.size(), {});
  }
  void Section(const Key& key, const Fields& fields) override {
    Json object = Object(fields);
    if (key.scalar_for != nullptr) object = {{"anyOf", {{{"type", "string"}}, std::move(object)}}};
    Add(key, std::move(object));
  }
  void Maps(const Key& key, size_t /*count*/,
            const std::function<void(size_t, FieldVisitor&)>& fields) override {
    Json item = Object([&](FieldVisitor& visit) { fields(0, visit); });
    Json property = {{"type", "array"}, {"items", std::move(item)}};
    if (key.required) property["minItems"] = 1;
    Add(key, std::move(property));
  }
  void Alternatives(const Key& key, size_t index, const Names& names,
                    const std::function<void(size_t, FieldVisitor&)>& fields) override {
    OneOf(key, index, names);
    for (size_t i = 0; i < names.size(); ++i) {
      Json then = {{"properties", Json::object()}};
      SchemaVisitor visit(then);
      fields(i, visit);
      const Json condition = {{"properties", {{key.name, {{"const", names[i]}}}}}, {"required", {key.name}}};
      object_["allOf"].push_back({{"if", condition}, {"then", std::move(then)}});
    }
  }

  Json& object_;

  friend Json taclink::FieldsJson(const FieldVisitor::Fields& fields);
};

}  // namespace

Json FieldsJson(const FieldVisitor::Fields& fields) {
  return SchemaVisitor::Object(fields);
}

std::string FieldsSchema(const std::string& title, const FieldVisitor::Fields& fields) {
  Json schema = {{"$schema", "https://json-schema.org/draft/2020-12/schema"}, {"title", title}};
  schema.update(FieldsJson(fields));
  return schema.dump(2) + "\n";
}

}  // namespace taclink
