#pragma once

#include <nats/nats.h>

#include <functional>
#include <memory>
#include <string>
#include <vector>

#include "tests/support/process.h"

namespace taclink::testing {

/// A nats-server with JetStream in a folder of its own; killed and gone at the end.
class NatsServer {
 public:
  /// `more`: lines of its configuration.
  explicit NatsServer(std::string more = "", bool jetstream = true);
  ~NatsServer();

  void Kill();
  /// At the same port, with what it had stored.
  void Start();
  std::string url() const { return "nats://127.0.0.1:" + std::to_string(port_); }
  pid_t pid() const { return process_->pid(); }
  const std::string& folder() const { return folder_; }

 private:
  const std::string folder_;
  const std::string more_;
  const bool jetstream_;
  int port_ = 0;
  std::unique_ptr<Process> process_;
};

struct Stored {
  std::string subject, bytes;
};

/// What a stream holds, oldest first, read until `done`; or until nothing comes for long.
std::vector<Stored> ReadStream(const std::string& url, const std::string& stream,
                               const std::function<bool(const std::vector<Stored>&)>& done);

}  // namespace taclink::testing
