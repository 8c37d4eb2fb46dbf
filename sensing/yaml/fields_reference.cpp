#include <array>
#include <utility>

#include "sensing/yaml/fields_json.h"

namespace taclink {
namespace {

using Json = nlohmann::ordered_json;

// The first that fits counts.
constexpr std::array<std::pair<std::string_view, std::string_view>, 16> kUnits = {{{"_per_unit", ""},
                                                                                   {"_mm_s", "mm/s"},
                                                                                   {"_kpa_s", "kPa/s"},
                                                                                   {"_per_s", "1/s"},
                                                                                   {"_100us", "100 µs"},
                                                                                   {"_deg", "degrees"},
                                                                                   {"_kpa", "kPa"},
                                                                                   {"kpa", "kPa"},
                                                                                   {"_pa", "Pa"},
                                                                                   {"_hz", "Hz"},
                                                                                   {"_mb", "MB"},
                                                                                   {"_kb", "kB"},
                                                                                   {"_mm", "mm"},
                                                                                   {"_px", "pixels"},
                                                                                   {"_s", "s"},
                                                                                   {"_n", "N"}}};

std::string TypeText(const std::string& key, const Json& property) {
  const auto& kind = property.at("type").get_ref<const std::string&>();
  std::string type = kind;
  if (property.contains("items"))
    type = "list of " +
           (property.contains("minItems") ? std::to_string(property.at("minItems").get<int>()) + " " : "") +
           property.at("items").at("type").get<std::string>() + "s";
  if (type.find("integer") == std::string::npos && type.find("number") == std::string::npos) return type;
  for (const auto& [suffix, unit] : kUnits) {
    if (key.ends_with(suffix)) return unit.empty() ? type : type + ", " + std::string(unit);
  }
  return type;
}

std::string RangeText(const Json& property) {
  if (property.contains("enum")) {
    std::string words;
    for (const auto& word : property.at("enum"))
      words += (words.empty() ? "`" : ", `") + word.get<std::string>() + "`";
    return words;
  }
  const Json& number = property.contains("items") ? property.at("items") : property;
  const bool has_min = number.contains("minimum"), has_max = number.contains("maximum");
  if (has_min && has_max) return number.at("minimum").dump() + " to " + number.at("maximum").dump();
  if (has_min) return "at least " + number.at("minimum").dump();
  return has_max ? "at most " + number.at("maximum").dump() : "";
}

bool IsRequired(const Json& object, const std::string& key) {
  if (!object.contains("required")) return false;
  const Json& required = object.at("required");
  return std::find(required.begin(), required.end(), key) != required.end();
}

// The object of a section, or of the items of a list of them; null: a value.
Json ObjectOf(const Json& property) {
  if (property.contains("anyOf")) return property.at("anyOf").back();
  if (property.at("type") == "object") return property;
  if (property.at("type") == "array" && property.at("items").at("type") == "object")
    return property.at("items");
  return nullptr;
}

void AddSection(std::string& out, const std::string& path, const Json& object);

void AddTable(std::string& out, const std::string& path, const Json& object) {
  std::string rows, below;
  for (const auto& [key, property] : object.at("properties").items()) {
    if (const Json section = ObjectOf(property); !section.is_null()) {
      const std::string whole =
          (path.empty() ? "" : path + ".") + key + (property.contains("items") ? "[]" : "");
      below += "\n## `" + whole + "`\n\n" + property.at("description").get<std::string>() + "\n";
      if (property.contains("anyOf")) below += "A text in place of the mapping is its first key.\n";
      AddSection(below, whole, section);
      continue;
    }
    const std::string unset = IsRequired(object, key)        ? "required"
                              : property.contains("default") ? "`" + property.at("default").dump() + "`"
                                                             : "none";
    rows += "| `" + key + "` | " + TypeText(key, property) + " | " + RangeText(property) + " | " + unset +
            " | " + property.at("description").get<std::string>() + " |\n";
  }
  if (!rows.empty())
    out += "\n| key | type, unit | range | default | meaning |\n|---|---|---|---|---|\n" + rows;
  out += below;
}

void AddSection(std::string& out, const std::string& path, const Json& object) {
  std::string alternatives;
  if (object.contains("allOf")) {
    for (const Json& alternative : object.at("allOf")) {
      const Json& then = alternative.at("then");
      if (then.at("properties").empty()) continue;
      const auto condition = alternative.at("if").at("properties").begin();
      alternatives +=
          "\nWith `" + condition.key() + ": " + condition->at("const").get<std::string>() + "`:\n";
      AddTable(alternatives, path, then);
    }
  }
  Json values = {{"properties", Json::object()}}, sections = values;
  if (object.contains("required")) values["required"] = object.at("required");
  for (const auto& [key, property] : object.at("properties").items())
    (ObjectOf(property).is_null() ? values : sections)["properties"][key] = property;
  AddTable(out, path, values);
  out += alternatives;
  AddTable(out, path, sections);
}

}  // namespace

std::string FieldsReference(const std::string& title, const std::string& introduction,
                            const FieldVisitor::Fields& fields) {
  std::string out = "# " + title + "\n\n" + introduction + "\n";
  AddSection(out, "", FieldsJson(fields));
  return out;
}

}  // namespace taclink
