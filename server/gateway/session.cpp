#include "server/gateway/session.h"

#include <spdlog/spdlog.h>

#include <array>
#include <boost/asio/as_tuple.hpp>
#include <boost/asio/co_spawn.hpp>
#include <boost/asio/detached.hpp>
#include <boost/asio/post.hpp>
#include <boost/asio/steady_timer.hpp>
#include <boost/asio/use_awaitable.hpp>
#include <utility>

#include "server/gateway/http_target.h"
#include "server/gateway/page_origin.h"
#include "server/security/party.h"

namespace taclink::server {
namespace {

namespace asio = boost::asio;
using std::chrono::steady_clock;

constexpr size_t kInputBytes = 32 * 1024;  // read ahead of what is parsed
constexpr size_t kFileBlock = 64 * 1024;
constexpr std::chrono::milliseconds kLinger{1000};
constexpr std::string_view kPlainText = "text/plain; charset=utf-8";
constexpr std::string_view kPrometheusText = "text/plain; version=0.0.4; charset=utf-8";

HttpHeaders CommonHeaders(std::string_view type, std::string caching) {
  return {{"Content-Type", std::string(type)},
          {"Cache-Control", std::move(caching)},
          {"X-Content-Type-Options", "nosniff"}};
}

// Nothing of the page may come from elsewhere, nor may it be framed elsewhere.
constexpr const char* kContentPolicy =
    "default-src 'self'; img-src 'self' data: blob:; style-src 'self' 'unsafe-inline'; worker-src 'self' "
    "blob:; object-src 'none'; base-uri 'none'; frame-ancestors 'none'";

int HttpStatusOf(ErrorCode code) {
  switch (code) {
    case ErrorCode::kUnauthenticated:
      return 401;
    case ErrorCode::kPermissionDenied:
      return 403;
    case ErrorCode::kNotFound:
      return 404;
    case ErrorCode::kResourceExhausted:
      return 429;
    case ErrorCode::kFailedPrecondition:
      return 503;
    default:
      return 400;
  }
}

int GrpcStatusOf(ErrorCode code) {
  switch (code) {
    case ErrorCode::kInvalidArgument:
      return 3;
    case ErrorCode::kPermissionDenied:
      return 7;
    case ErrorCode::kResourceExhausted:
      return 8;
    case ErrorCode::kFailedPrecondition:
      return 9;
    case ErrorCode::kUnsupported:
      return 12;
    case ErrorCode::kUnauthenticated:
      return 16;
    default:
      return 13;
  }
}

bool IsProbe(const HttpRequest& request) {
  const auto path = PathOfTarget(request.target);
  return (request.method == "GET" || request.method == "HEAD") && path &&
         (*path == "/healthz" || *path == "/readyz");
}

}  // namespace

asio::awaitable<void> Signal::Wait() {
  while (!set_) co_await timer_.async_wait(asio::as_tuple(asio::use_awaitable));
  set_ = false;
}

Session::Session(std::shared_ptr<GatewayShared> shared, std::unique_ptr<Connection> connection,
                 std::string peer, std::string busy)
    : shared_(std::move(shared)),
      connection_(std::move(connection)),
      peer_(std::move(peer)),
      busy_(std::move(busy)),
      parser_(shared_->options.http),
      news_(shared_->loop),
      room_(shared_->loop) {}

asio::awaitable<void> Session::Run() {
  waiting_since_ = steady_clock::now();
  SetDeadline(shared_->options.header_timeout);
  if (co_await connection_->Handshake()) {
    asio::co_spawn(shared_->loop, [self = shared_from_this()] { return self->ReadAll(); }, asio::detached);
    bool go_on = true;
    while (go_on && !closed_) {
      const auto request = co_await NextRequest();
      if (!request) break;
      waiting_since_.reset();
      go_on = co_await Answer(*request);
      waiting_since_ = steady_clock::now();
      SetDeadline(shared_->options.idle_timeout);
    }
    co_await Linger();
  }
  Close();
}

void Session::Close() {
  closed_ = ended_ = true;
  connection_->Close();
  news_.Set();
  room_.Set();
}

void Session::CloseIfLate(TimePoint now) {
  if (now >= deadline_) Close();
}

void Session::SetDeadline(std::chrono::milliseconds from_now) {
  deadline_ = steady_clock::now() + from_now;
}

asio::awaitable<void> Session::ReadAll() {
  std::array<char, 8192> block;
  while (!ended_) {
    if (input_.size() >= kInputBytes) {
      co_await room_.Wait();
      continue;
    }
    const size_t size = co_await connection_->Read(block);
    if (size == 0) break;
    input_.append(block.data(), size);
    news_.Set();
  }
  ended_ = true;
  news_.Set();
}

asio::awaitable<std::optional<HttpRequest>> Session::NextRequest() {
  bool late_set = false;
  while (!closed_) {
    const size_t used = parser_.Feed(input_);
    input_.erase(0, used);
    room_.Set();
    if (parser_.failure()) {
      const HttpFailure failure = *parser_.failure();
      const std::string head = ResponseHead(failure.status, CommonHeaders(kPlainText, "no-store"),
                                            failure.message.size() + 1, false);
      co_await Write(head + failure.message + "\n");
      co_return std::nullopt;
    }
    if (parser_.Done()) co_return parser_.Take();
    if (parser_.TakeWantsContinue() && !co_await Write("HTTP/1.1 100 Continue\r\n\r\n")) break;
    if (used > 0 && !input_.empty()) continue;
    if (ended_) break;
    if (parser_.begun() && !std::exchange(late_set, true)) SetDeadline(shared_->options.header_timeout);
    co_await news_.Wait();
  }
  co_return std::nullopt;
}

// Lets the client read the last answer: closing with bytes unread would take it away.
asio::awaitable<void> Session::Linger() {
  if (closed_) co_return;
  connection_->EndWriting();
  SetDeadline(kLinger);
  while (!ended_) {
    input_.clear();
    room_.Set();
    co_await news_.Wait();
  }
}

asio::awaitable<bool> Session::Write(std::string_view bytes) {
  if (closed_) co_return false;
  const TimePoint before = std::exchange(deadline_, steady_clock::now() + shared_->options.write_timeout);
  const bool written = co_await connection_->Write(bytes);
  deadline_ = before;
  co_return written;
}

std::optional<HttpFailure> Session::Objection(const HttpRequest& request) const {
  if (shared_->draining) return HttpFailure{503, "the server is shutting down"};
  if (!busy_.empty() && !IsProbe(request)) {
    SPDLOG_INFO("http {}: {} refused: {}", peer_, request.target, busy_);
    return HttpFailure{429, busy_};
  }
  return ForeignPage(request, shared_->loopback_only && !shared_->services.security->needs_token());
}

Session::Outcome Session::Answer(const HttpRequest& request) {
  ++shared_->services.counts->requests;
  deadline_ = TimePoint::max();
  if (const auto objection = Objection(request))
    co_return co_await AnswerText(request, objection->status, kPlainText, objection->message + "\n");
  if (const auto format = WebFormatOf(request.Header("content-type"));
      format && request.method == "POST" && IsMethodPath(request.target))
    co_return co_await AnswerCall(request, *format);
  if (request.method != "GET" && request.method != "HEAD")
    co_return co_await AnswerText(request, 405, kPlainText,
                                  "only GET, HEAD, and POST of gRPC-Web messages to a gRPC method\n");
  const auto path = PathOfTarget(request.target);
  if (!path) co_return co_await AnswerText(request, 400, kPlainText, path.error().message + "\n");
  co_return co_await AnswerPage(request, *path);
}

Session::Outcome Session::AnswerPage(const HttpRequest& request, const std::string& path) {
  if (path != "/healthz" && path != "/readyz" && path != "/metrics") return AnswerFile(request, path);
  const auto caller =
      shared_->services.security->Check(path, request.Header("authorization"), PlaceOf(peer_).address);
  if (!caller)
    return AnswerText(request, HttpStatusOf(caller.error().code), kPlainText, caller.error().message + "\n");
  if (path == "/healthz") return AnswerText(request, 200, kPlainText, "ok\n");
  if (path == "/metrics") return AnswerText(request, 200, kPrometheusText, shared_->services.metrics());
  const Readiness readiness = shared_->services.readiness();
  return AnswerText(request, readiness.ready ? 200 : 503, kPlainText, readiness.text);
}

Session::Outcome Session::AnswerText(const HttpRequest& request, int status, std::string_view type,
                                     std::string text) {
  const bool keep = request.keep_alive && status != 503 && status != 429 && busy_.empty();
  HttpHeaders headers = CommonHeaders(type, "no-store");
  if (status == 401) headers.emplace_back("WWW-Authenticate", "Bearer");
  if (status == 429) headers.emplace_back("Retry-After", "60");
  if (status == 405) headers.emplace_back("Allow", "GET, HEAD, POST");
  // The page shows it, in place of the status.
  if (status != 200 && WebFormatOf(request.Header("content-type")))
    headers.emplace_back("Grpc-Message", PercentEncoded(text.substr(0, text.find('\n'))));
  std::string out = ResponseHead(status, headers, text.size(), keep);
  if (request.method != "HEAD") out += text;
  co_return co_await Write(out) && keep;
}

Session::Outcome Session::AnswerFile(const HttpRequest& request, const std::string& path) {
  auto file = shared_->files.Find(path, TakesGzip(request.Header("accept-encoding")));
  if (!file) co_return co_await AnswerText(request, 404, kPlainText, file.error().message + "\n");
  HttpHeaders headers =
      CommonHeaders(file->type, file->never_changes ? "public, max-age=31536000, immutable" : "no-cache");
  const std::string tag = "\"" + file->tag + "\"";
  headers.emplace_back("ETag", tag);
  headers.emplace_back("Vary", "Accept-Encoding");
  if (file->gzip) headers.emplace_back("Content-Encoding", "gzip");
  headers.emplace_back("Content-Security-Policy", kContentPolicy);
  headers.emplace_back("Referrer-Policy", "no-referrer");
  const bool known = request.Header("if-none-match") == tag;
  const std::string head =
      ResponseHead(known ? 304 : 200, headers, known ? 0 : file->size, request.keep_alive);
  if (!co_await Write(head)) co_return false;
  if (known || request.method == "HEAD") co_return request.keep_alive;
  uint64_t sent = 0;
  while (sent < file->size) {
    const std::string block = file->Read(kFileBlock);
    if (block.empty() || !co_await Write(block)) co_return false;  // the length was promised
    sent += block.size();
  }
  co_return request.keep_alive;
}

Result<GrpcCallRequest> Session::ToCall(const HttpRequest& request, WebFormat format) const {
  const auto caller = shared_->services.security->Check(request.target, request.Header("authorization"),
                                                        PlaceOf(peer_).address);
  if (!caller) {
    SPDLOG_INFO("http {}: {} refused: {}", peer_, request.target, caller.error().message);
    return caller.error();
  }
  auto messages = DecodeMessages(format, request.body);
  if (!messages) return messages.error();
  GrpcCallRequest call{.method = request.target,
                       .messages = std::move(*messages),
                       .timeout = {},
                       .peer = peer_,
                       .name = caller->name.empty() ? connection_->ClientName() : caller->name,
                       .role = static_cast<char>(caller->role)};
  if (const auto timeout = request.Header("grpc-timeout"); !timeout.empty()) {
    call.timeout = ParseGrpcTimeout(timeout);
    if (!call.timeout)
      return Error{ErrorCode::kInvalidArgument, "grpc-timeout must be up to 8 digits and one of H M S m u n"};
  }
  return call;
}

Session::Outcome Session::AnswerCall(const HttpRequest& request, WebFormat format) {
  const StreamedResponse response(request);
  auto call = ToCall(request, format);
  HttpHeaders headers = CommonHeaders(ContentTypeOf(format), "no-store");
  headers.emplace_back("X-Accel-Buffering", "no");  // a proxy that collects answers would hold frames back
  const std::string head = response.Head(200, headers);
  if (!call) {
    const WebStatus status{GrpcStatusOf(call.error().code), call.error().message};
    co_return co_await Write(head + response.Piece(EncodeTrailers(format, status)) + response.End()) &&
        response.keeps_alive();
  }
  if (!co_await Write(head)) co_return false;
  ++shared_->services.counts->calls;
  const bool whole = co_await Forward(std::move(*call), format, response);
  --shared_->services.counts->calls;
  co_return whole&& response.keeps_alive();
}

// Until the next answer can be sent soon, as far as it is one that grows old.
asio::awaitable<void> Session::WaitToSend(const std::string& method) {
  if (method.ends_with("/StreamEvents")) co_return;  // few and small, and urgent
  const TimePoint before = std::exchange(deadline_, steady_clock::now() + shared_->options.write_timeout);
  while (!ended_ && !closed_) {
    const std::chrono::milliseconds delay = connection_->SendDelay();
    if (delay.count() == 0) break;
    asio::steady_timer timer(shared_->loop, delay);
    co_await timer.async_wait(asio::as_tuple(asio::use_awaitable));
  }
  deadline_ = before;
}

// Each answer is written before the next one is read.
Session::Outcome Session::Forward(GrpcCallRequest call_request, WebFormat format,
                                  const StreamedResponse& response) {
  const std::string method = call_request.method;
  const auto call =
      shared_->calls.Start(std::move(call_request), [weak = weak_from_this(), shared = shared_] {
        asio::post(shared->loop, [weak] {
          if (const auto session = weak.lock()) session->news_.Set();
        });
      });
  while (!ended_) {
    const auto event = call->Take();
    if (!event) {
      co_await news_.Wait();
      continue;
    }
    if (const auto* status = std::get_if<WebStatus>(&*event))
      co_return co_await Write(response.Piece(EncodeTrailers(format, *status)) + response.End());
    if (!co_await Write(response.Piece(EncodeMessage(format, std::get<std::string>(*event))))) break;
    co_await WaitToSend(method);
  }
  co_return false;
}

}  // namespace taclink::server
