#include "server/gateway/http_message.h"

#include <algorithm>
#include <boost/asio/buffer.hpp>
#include <boost/beast/http/parser.hpp>
#include <boost/beast/http/status.hpp>
#include <boost/beast/http/string_body.hpp>
#include <cstdio>

namespace taclink::server {
namespace {

namespace http = boost::beast::http;

std::string Lower(std::string_view text) {
  std::string out(text);
  std::transform(out.begin(), out.end(), out.begin(),
                 [](char c) { return c >= 'A' && c <= 'Z' ? static_cast<char>(c - 'A' + 'a') : c; });
  return out;
}

HttpFailure FailureOf(const boost::system::error_code& error, const HttpLimits& limits) {
  if (error == http::error::header_limit)
    return {431, "the request's headers are longer than " + std::to_string(limits.header_bytes) + " bytes"};
  if (error == http::error::body_limit)
    return {413, "the request's body is longer than " + std::to_string(limits.body_bytes) + " bytes"};
  if (error == http::error::bad_version) return {505, "only HTTP/1.0 and HTTP/1.1 are spoken here"};
  return {400, "this is no HTTP request: " + error.message()};
}

std::string HeadOf(int status, const HttpHeaders& headers, const std::string& framing, bool keep_alive) {
  const auto reason = http::obsolete_reason(http::int_to_status(static_cast<unsigned>(status)));
  std::string out = "HTTP/1.1 " + std::to_string(status) + " " + std::string(reason) + "\r\n";
  for (const auto& [name, value] : headers) out.append(name).append(": ").append(value).append("\r\n");
  out += framing;
  return out += keep_alive ? "Connection: keep-alive\r\n\r\n" : "Connection: close\r\n\r\n";
}

}  // namespace

struct HttpRequestParser::Parser {
  http::request_parser<http::string_body> beast;
};

std::string_view HttpRequest::Header(std::string_view lower_name) const {
  const auto at = std::find_if(headers.begin(), headers.end(),
                               [&](const auto& header) { return header.first == lower_name; });
  return at == headers.end() ? std::string_view() : std::string_view(at->second);
}

HttpRequestParser::HttpRequestParser(HttpLimits limits) : limits_(limits) {
  Reset();
}

HttpRequestParser::~HttpRequestParser() = default;

void HttpRequestParser::Reset() {
  parser_ = std::make_unique<Parser>();
  parser_->beast.header_limit(
      static_cast<std::uint32_t>(2 * limits_.header_bytes));  // FeedOnce counts exactly
  parser_->beast.body_limit(limits_.body_bytes);
  head_ = {};
  head_bytes_ = 0;
  begun_ = head_seen_ = wants_continue_ = false;
}

size_t HttpRequestParser::Feed(std::string_view bytes) {
  size_t used = FeedOnce(bytes);
  // The head is judged before the body is looked at.
  if (head_seen_ && !parser_->beast.eager()) {
    parser_->beast.eager(true);
    used += FeedOnce(bytes.substr(used));
    wants_continue_ = wants_continue_ && !Done();
  }
  return used;
}

size_t HttpRequestParser::FeedOnce(std::string_view bytes) {
  if (failure_ || Done() || bytes.empty()) return 0;
  boost::system::error_code error;
  begun_ = true;
  const size_t used = parser_->beast.put(boost::asio::const_buffer(bytes.data(), bytes.size()), error);
  if (!head_seen_) head_bytes_ += used;
  const size_t waiting = parser_->beast.is_header_done() ? 0 : bytes.size() - used;
  if (error && error != http::error::need_more) {
    failure_ = FailureOf(error, limits_);
  } else if (head_bytes_ + waiting > limits_.header_bytes) {
    failure_ = FailureOf(http::error::header_limit, limits_);
  } else if (parser_->beast.is_header_done() && !head_seen_) {
    head_seen_ = true;
    KeepHead();
  }
  return used;
}

void HttpRequestParser::KeepHead() {
  const auto& head = parser_->beast.get();
  // Headers that something is decided by and that hold one value. A proxy before this server could read
  // another one of two than this server does.
  for (const char* const once :
       {"host", "authorization", "content-type", "content-length", "origin", "expect", "grpc-timeout"}) {
    if (const size_t count = head.count(once); count > 1)
      failure_ = {400, "the request has " + std::to_string(count) + " '" + once + "' headers; send one"};
  }
  if (head.version() == 11 && head.count(http::field::host) == 0)
    failure_ = {400, "the request has no 'host' header"};
  // Boost.Beast's reading of chunks depends on how the network cuts them: they are not for any client to
  // send.
  if (head.count(http::field::transfer_encoding) > 0)
    failure_ = {411, "bodies have to come with a content-length, not in chunks"};
  if (const auto expect = head[http::field::expect]; !expect.empty()) {
    if (Lower(expect) != "100-continue") failure_ = {417, "what the request expects is not offered here"};
    wants_continue_ = !failure_;
  }
  head_ = {.method = std::string(head.method_string()),
           .target = std::string(head.target()),
           .http_1_0 = head.version() == 10,
           .keep_alive = head.keep_alive(),
           .headers = {},
           .body = {}};
  for (const auto& field : head) head_.headers.emplace_back(Lower(field.name_string()), field.value());
}

bool HttpRequestParser::TakeWantsContinue() {
  return std::exchange(wants_continue_, false);
}

bool HttpRequestParser::Done() const {
  return parser_->beast.is_done();
}

HttpRequest HttpRequestParser::Take() {
  HttpRequest out = std::move(head_);
  out.body = std::move(parser_->beast.get().body());
  Reset();
  return out;
}

std::string ResponseHead(int status, const HttpHeaders& headers, size_t length, bool keep_alive) {
  return HeadOf(status, headers, "Content-Length: " + std::to_string(length) + "\r\n", keep_alive);
}

std::string StreamedResponse::Head(int status, const HttpHeaders& headers) const {
  return HeadOf(status, headers, in_chunks_ ? "Transfer-Encoding: chunked\r\n" : "", keeps_alive_);
}

std::string StreamedResponse::Piece(std::string_view bytes) const {
  if (!in_chunks_) return std::string(bytes);
  char head[24];
  const int size = std::snprintf(head, sizeof head, "%zx\r\n", bytes.size());
  std::string out(head, static_cast<size_t>(size));
  return out.append(bytes).append("\r\n");
}

std::string StreamedResponse::End() const {
  return in_chunks_ ? "0\r\n\r\n" : "";
}

}  // namespace taclink::server
