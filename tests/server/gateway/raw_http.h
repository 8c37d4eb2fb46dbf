#pragma once

#include <map>
#include <optional>
#include <string>
#include <string_view>

namespace taclink::server {

struct RawResponse {
  int status = 0;                              ///< 0: none came
  std::map<std::string, std::string> headers;  ///< names in lower case
  std::string body;
};

/// A plain socket to a server, so that a test can send anything.
class RawHttp {
 public:
  /// `address` is host:port; `from`: one of this machine's addresses.
  explicit RawHttp(const std::string& address, const char* from = "127.0.0.1");
  ~RawHttp();
  RawHttp(const RawHttp&) = delete;
  RawHttp& operator=(const RawHttp&) = delete;

  void Send(std::string_view bytes);
  /// One whole response. `has_body` false: as for HEAD.
  RawResponse Read(bool has_body = true);
  /// Only its head; what follows stays for ReadChunk.
  RawResponse ReadHead();
  /// The next chunk of a body in chunks; none: the body or the connection has ended.
  std::optional<std::string> ReadChunk();
  /// Waits until the server closes the connection; gives what came before.
  std::string ReadToEnd();
  void EndWriting();
  void Close();

 private:
  bool Fill();
  std::optional<std::string> TakeLine();
  bool TakeBytes(size_t count, std::string& out);

  int socket_ = -1;
  std::string input_;
};

/// One request on a connection of its own.
RawResponse Get(const std::string& address, const std::string& target, const std::string& more_headers = "");
RawResponse Ask(const std::string& address, const std::string& text);

}  // namespace taclink::server
