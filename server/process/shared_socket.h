#pragma once

#include <unistd.h>

#include <chrono>

#include "server/process/send_delay.h"

namespace taclink::server {

/// A descriptor of a connection's socket beside gRPC's own, which gRPC may close at any time. Any thread.
class SharedSocket {
 public:
  /// Takes over the descriptor.
  explicit SharedSocket(int fd) : fd_(fd) {}
  ~SharedSocket() { ::close(fd_); }
  SharedSocket(const SharedSocket&) = delete;
  SharedSocket& operator=(const SharedSocket&) = delete;

  int fd() const { return fd_; }
  std::chrono::milliseconds SendDelay() const { return server::SendDelay(fd_); }

 private:
  const int fd_;
};

}  // namespace taclink::server
