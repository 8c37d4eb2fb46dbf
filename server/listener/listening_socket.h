#pragma once

#include <sys/types.h>

#include <string>
#include <vector>

#include "sensing/core/address.h"
#include "sensing/core/result.h"

namespace taclink::server {

/// The sockets that listen on one configured address. Non-blocking.
class ListeningSockets {
 public:
  /// host:port, [ip6]:port (port 0: any free one, the same for all addresses of the host) or unix:path, whose
  /// file is replaced where nobody listens on it. Errors: kUnavailable.
  static Result<ListeningSockets> Open(const std::string& address);
  ~ListeningSockets() { Close(); }
  ListeningSockets(ListeningSockets&& other) noexcept;
  ListeningSockets& operator=(ListeningSockets&&) = delete;

  const std::vector<int>& sockets() const { return sockets_; }
  /// With the real port.
  const std::string& address() const { return address_; }
  bool is_unix() const { return !path_.empty(); }
  /// And removes the file of a unix socket, if it is still this one's.
  void Close();

 private:
  ListeningSockets() = default;
  Result<void> OpenUnix(const std::string& path);
  Result<void> OpenTcp(const HostPort& where);

  std::vector<int> sockets_;
  std::string address_, path_;
  ino_t inode_ = 0;  // of the file
};

}  // namespace taclink::server
