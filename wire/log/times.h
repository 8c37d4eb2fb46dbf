#pragma once

#include <google/protobuf/timestamp.pb.h>

#include <cstdint>

namespace taclink::wire::log {

/// ns since 1970-01-01 UTC, not negative.
inline void Fill(int64_t utc_ns, google::protobuf::Timestamp& out) {
  out.set_seconds(utc_ns / 1'000'000'000);
  out.set_nanos(static_cast<int32_t>(utc_ns % 1'000'000'000));
}

}  // namespace taclink::wire::log
