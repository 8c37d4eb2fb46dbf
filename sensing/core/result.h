#pragma once

#include <cassert>
#include <string>
#include <utility>
#include <variant>

namespace taclink {

/// Kinds of expected failure. Each maps to one gRPC status code in `server`.
enum class ErrorCode {
  kInvalidArgument,     ///< the caller's input is wrong: a file, an option, a value
  kNotFound,            ///< a file, device or link that is not there
  kUnavailable,         ///< may work later: a camera unplugged, a server down
  kTimeout,             ///< nothing came in time; call again
  kEndOfData,           ///< a finite source has no more frames
  kFailedPrecondition,  ///< the state does not allow it: no rest picture yet
  kResourceExhausted,   ///< a configured limit is reached
  kUnsupported,         ///< known, but not offered by this build or device
  kUnauthenticated,     ///< the caller has not shown who it is
  kPermissionDenied,    ///< the caller may not do this
  kInternal,            ///< a defect of this program
};

/// What failed, where, and what to do about it, in one line; of a file that was read, in one line per error.
struct Error {
  ErrorCode code = ErrorCode::kInternal;
  std::string message;
};

/// A value or the error that prevented it. For expected failures at boundaries; see design, section 7.
template <typename T>
class [[nodiscard]] Result {
 public:
  Result(T value)
      : state_(std::in_place_index<0>, std::move(value)) {}  // NOLINT(google-explicit-constructor)
  Result(Error error)
      : state_(std::in_place_index<1>, std::move(error)) {}  // NOLINT(google-explicit-constructor)

  bool ok() const { return state_.index() == 0; }
  explicit operator bool() const { return ok(); }

  T& value() & { return assert(ok()), std::get<0>(state_); }
  const T& value() const& { return assert(ok()), std::get<0>(state_); }
  T&& value() && { return assert(ok()), std::get<0>(std::move(state_)); }
  T& operator*() & { return value(); }
  const T& operator*() const& { return value(); }
  T&& operator*() && { return std::move(*this).value(); }
  T* operator->() { return &value(); }
  const T* operator->() const { return &value(); }

  const Error& error() const { return assert(!ok()), std::get<1>(state_); }

 private:
  std::variant<T, Error> state_;
};

template <>
class [[nodiscard]] Result<void> {
 public:
  Result() = default;
  Result(Error error) : error_(std::move(error)), ok_(false) {}  // NOLINT(google-explicit-constructor)

  bool ok() const { return ok_; }
  explicit operator bool() const { return ok_; }
  const Error& error() const { return assert(!ok_), error_; }

 private:
  Error error_;
  bool ok_ = true;
};

}  // namespace taclink
