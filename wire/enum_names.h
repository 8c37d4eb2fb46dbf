#pragma once

#include <google/protobuf/descriptor.h>
#include <google/protobuf/generated_enum_reflection.h>

#include <optional>
#include <string>
#include <string_view>
#include <vector>

namespace taclink::wire {

/// The names of an enum as people and files see them, by reflection of its .proto: EVENT_KIND_FORCE_LEVEL of
/// EventKind is "force_level". Number 0 (..._UNSPECIFIED) is "unknown", or "unspecified" in an enum that has
/// a value of its own for that; numbers that this version does not have are "unknown". Any thread.
class EnumNames {
 public:
  explicit EnumNames(const google::protobuf::EnumDescriptor& descriptor);

  /// Null-terminated; lasts as long as this object.
  const char* Name(int number) const;
  /// None: no value but number 0 has this name.
  std::optional<int> Number(std::string_view name) const;
  /// All but number 0, in the order of the .proto.
  std::vector<std::string> All() const;

 private:
  struct Value {
    int number;
    std::string name;
  };
  std::vector<Value> values_;  // without number 0
  const char* zero_ = "unknown";
};

/// Made once for each type; lasts as long as the program, also while its threads outlive main.
const EnumNames& NamesOf(const google::protobuf::EnumDescriptor& type);

template <typename Enum>
const EnumNames& NamesOf() {
  static const EnumNames& names = NamesOf(*google::protobuf::GetEnumDescriptor<Enum>());
  return names;
}

}  // namespace taclink::wire
