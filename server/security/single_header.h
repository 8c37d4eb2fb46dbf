#pragma once

#include <cstddef>
#include <string>
#include <string_view>

#include "sensing/core/result.h"

namespace taclink::server {

/// The value of a header that a call may have once. Everything that decides by such a header reads it here:
/// of two values one check would see the first and another the last, and the caller would be let in as one
/// and audited as the other.
class SingleHeader {
 public:
  explicit SingleHeader(std::string_view lower_name) : name_(lower_name) {}

  /// To be called with each header of the call, names in lower case. `value` outlives this.
  void Read(std::string_view name, std::string_view value) {
    if (name != name_) return;
    ++count_;
    value_ = value;
  }

  /// Empty: the call does not have it. Errors: kUnauthenticated (it has several).
  Result<std::string_view> Value() const {
    if (count_ <= 1) return value_;
    return Error{ErrorCode::kUnauthenticated, "the call has " + std::to_string(count_) + " '" +
                                                  std::string(name_) +
                                                  "' headers, which may name different callers; send one"};
  }

 private:
  std::string_view name_, value_;
  size_t count_ = 0;
};

}  // namespace taclink::server
