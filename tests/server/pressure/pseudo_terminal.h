#pragma once

#include <fcntl.h>
#include <gtest/gtest.h>
#include <poll.h>
#include <unistd.h>

#include <cstdlib>
#include <string>

#include "tests/server/support.h"

namespace taclink::server {

/// A serial line: the test is the device at its other end.
class PseudoTerminal {
 public:
  PseudoTerminal() : master_(posix_openpt(O_RDWR | O_NOCTTY)) {
    EXPECT_GE(master_, 0);
    EXPECT_EQ(grantpt(master_), 0);
    EXPECT_EQ(unlockpt(master_), 0);
  }
  ~PseudoTerminal() { Close(); }
  std::string device() const { return ptsname(master_); }
  void Send(const std::string& text) const {
    EXPECT_EQ(write(master_, text.data(), text.size()), static_cast<ssize_t>(text.size()));
  }
  /// The next line, without its end. Empty: none came.
  std::string Receive() {
    while (true) {
      if (const auto end = received_.find('\n'); end != std::string::npos) {
        const std::string line = received_.substr(0, end);
        received_.erase(0, end + 1);
        return line;
      }
      pollfd waiting{.fd = master_, .events = POLLIN, .revents = 0};
      char buffer[256];
      if (poll(&waiting, 1, static_cast<int>(std::chrono::milliseconds(kForever).count())) <= 0) return {};
      const ssize_t got = read(master_, buffer, sizeof buffer);
      if (got <= 0) return {};
      received_.append(buffer, static_cast<size_t>(got));
    }
  }
  void Close() {
    if (master_ >= 0) close(master_);
    master_ = -1;
  }

 private:
  int master_;
  std::string received_;
};

}  // namespace taclink::server
