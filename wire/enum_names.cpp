#include "wire/enum_names.h"

#include <algorithm>
#include <cctype>
#include <map>
#include <mutex>

namespace taclink::wire {
namespace {

std::string LowerCase(std::string_view text) {
  std::string out(text);
  for (char& c : out) c = static_cast<char>(std::tolower(static_cast<unsigned char>(c)));
  return out;
}

}  // namespace

EnumNames::EnumNames(const google::protobuf::EnumDescriptor& descriptor) {
  // By the style of the API every value begins with the enum's name, and number 0 ends with UNSPECIFIED.
  constexpr std::string_view kUnspecified = "UNSPECIFIED";
  const std::string& zero = descriptor.value(0)->name();
  const size_t prefix = zero.size() - std::min(zero.size(), kUnspecified.size());
  for (int i = 1; i < descriptor.value_count(); ++i) {
    const auto& value = *descriptor.value(i);
    values_.push_back({value.number(), LowerCase(std::string_view(value.name()).substr(prefix))});
    if (values_.back().name == "unknown") zero_ = "unspecified";
  }
}

const char* EnumNames::Name(int number) const {
  if (number == 0) return zero_;
  const auto found = std::ranges::find(values_, number, &Value::number);
  return found == values_.end() ? "unknown" : found->name.c_str();
}

std::optional<int> EnumNames::Number(std::string_view name) const {
  const auto found = std::ranges::find(values_, name, &Value::name);
  if (found == values_.end()) return std::nullopt;
  return found->number;
}

std::vector<std::string> EnumNames::All() const {
  std::vector<std::string> names;
  for (const Value& value : values_) names.push_back(value.name);
  return names;
}

const EnumNames& NamesOf(const google::protobuf::EnumDescriptor& type) {
  static std::mutex mutex;
  static auto& known = *new std::map<const google::protobuf::EnumDescriptor*, EnumNames>;  // never destroyed
  const std::lock_guard lock(mutex);
  return known.try_emplace(&type, type).first->second;
}

}  // namespace taclink::wire
