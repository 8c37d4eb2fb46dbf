#pragma once

#include <google/protobuf/descriptor.h>
#include <google/protobuf/generated_enum_reflection.h>

#include <optional>
#include <string>
#include <string_view>
#include <vector>

namespace taclink::wire {

/// The names of an enum as people and files see them, by reflection of its .proto: EVENT_KIND_FORCE_LEVEL of
/// EventKind is "force_level". Number 0 (..._UNSPECIFIED) and numbers that this version does not have are
/// "unknown". Any thread.
class EnumNames {
 public:
  explicit EnumNames(const google::protobuf::EnumDescriptor& descriptor);

  /// Lasts as long as the program, null-terminated.
  const char* Name(int number) const;
  /// None: no value has this name. "unknown" is none.
  std::optional<int> Number(std::string_view name) const;
  /// All but number 0, in the order of the .proto.
  std::vector<std::string> All() const;

 private:
  struct Value {
    int number;
    std::string name;
  };
  std::vector<Value> values_;  // without number 0
};

template <typename Enum>
const EnumNames& NamesOf() {
  static const EnumNames names(*google::protobuf::GetEnumDescriptor<Enum>());
  return names;
}

}  // namespace taclink::wire
