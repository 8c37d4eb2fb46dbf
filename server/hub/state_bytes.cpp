#include "server/hub/state_bytes.h"

#include "sensing/core/link_state_fields.h"

namespace taclink::server {
namespace {

// Memory that `value` keeps besides itself, bytes.
template <typename T>
size_t BufferBytes(const T& value) {
  size_t bytes = 0;
  if constexpr (HasFields<const T>) {
    VisitFields(value, [&bytes](const char*, const auto& member) { bytes += BufferBytes(member); });
  } else if constexpr (kIsVector<T>) {
    bytes = value.capacity() * sizeof(typename T::value_type);
    if constexpr (!std::is_trivially_destructible_v<typename T::value_type>)
      for (const auto& element : value) bytes += BufferBytes(element);
  } else if constexpr (kIsOptional<T>) {
    if (value) bytes = BufferBytes(*value);
  } else if constexpr (std::same_as<T, std::string>) {
    bytes = value.capacity();
  } else {
    static_assert(std::is_trivially_destructible_v<T>, "owns memory: needs VisitFields");
  }
  return bytes;
}

}  // namespace

size_t StateBytes(const LinkState& state) {
  return sizeof state + BufferBytes(state);
}

}  // namespace taclink::server
