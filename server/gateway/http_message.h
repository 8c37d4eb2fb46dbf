#pragma once

#include <cstddef>
#include <initializer_list>
#include <memory>
#include <optional>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

namespace taclink::server {

/// One HTTP/1 request, whole.
struct HttpRequest {
  std::string method = {};
  std::string target = {};  ///< as sent
  bool http_1_0 = false;
  bool keep_alive = true;
  std::vector<std::pair<std::string, std::string>> headers = {};  ///< names in lower case
  std::string body = {};

  /// Empty: not sent.
  std::string_view Header(std::string_view lower_name) const;
};

struct HttpLimits {
  size_t header_bytes = 8 * 1024;
  size_t body_bytes = 96 * 1024;  ///< gRPC's largest request in base64 and some
};

/// Why a request is refused: an HTTP status and what to tell.
struct HttpFailure {
  int status = 400;
  std::string message;
};

/// Makes requests of bytes as they come. No sockets; any bytes.
class HttpRequestParser {
 public:
  explicit HttpRequestParser(HttpLimits limits);
  ~HttpRequestParser();

  /// Uses up some of `bytes` and returns how many; the rest is to be given again, with more behind it. After
  /// Done or failure: 0.
  size_t Feed(std::string_view bytes);

  /// The request is whole: Take it, then the next one can follow.
  bool Done() const;
  HttpRequest Take();
  /// The connection is of no further use.
  const std::optional<HttpFailure>& failure() const { return failure_; }
  /// Some of a request was used up.
  bool begun() const { return begun_; }
  /// Once: the client waits for "100 Continue" before it sends the body.
  bool TakeWantsContinue();

 private:
  struct Parser;
  void Reset();
  size_t FeedOnce(std::string_view bytes);
  void KeepHead();

  const HttpLimits limits_;
  std::unique_ptr<Parser> parser_;
  HttpRequest head_;
  std::optional<HttpFailure> failure_;
  size_t head_bytes_ = 0;
  bool begun_ = false;
  bool head_seen_ = false;
  bool wants_continue_ = false;
};

using HttpHeaders = std::vector<std::pair<std::string_view, std::string>>;

/// The head of a response whose body has `length` bytes, with the blank line.
std::string ResponseHead(int status, const HttpHeaders& headers, size_t length, bool keep_alive);

/// A response whose length is not known beforehand: its body comes in chunks, or, for a client of HTTP/1.0,
/// which has none, ends with the connection.
class StreamedResponse {
 public:
  explicit StreamedResponse(const HttpRequest& request)
      : in_chunks_(!request.http_1_0), keeps_alive_(in_chunks_ && request.keep_alive) {}

  /// Whether another request can follow.
  bool keeps_alive() const { return keeps_alive_; }
  std::string Head(int status, const HttpHeaders& headers) const;
  /// A piece of the body, which is not empty.
  std::string Piece(std::string_view bytes) const;
  /// What ends the body.
  std::string End() const;

 private:
  const bool in_chunks_, keeps_alive_;
};

}  // namespace taclink::server
