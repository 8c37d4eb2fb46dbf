#pragma once

#include <boost/asio/awaitable.hpp>
#include <boost/asio/io_context.hpp>
#include <boost/asio/steady_timer.hpp>
#include <chrono>
#include <limits>
#include <memory>
#include <optional>
#include <string>
#include <string_view>

#include "server/gateway/connection.h"
#include "server/gateway/gateway.h"
#include "server/gateway/grpc_call.h"
#include "server/gateway/http_message.h"
#include "server/gateway/static_files.h"

namespace taclink::server {

/// What all sessions of a gateway share. One thread, but for what gRPC's threads post.
struct GatewayShared {
  GatewayShared(GatewayOptions the_options, GatewayServices the_services, StaticFiles the_files)
      : options(std::move(the_options)),
        services(std::move(the_services)),
        files(std::move(the_files)),
        calls(services.channel) {}

  // Constant after construction.
  const GatewayOptions options;
  const GatewayServices services;
  const StaticFiles files;
  GrpcCalls calls;
  bool loopback_only = false;  // set before the first session

  bool draining = false;
  boost::asio::io_context loop;
};

/// Lets one coroutine wait for another.
class Signal {
 public:
  explicit Signal(boost::asio::io_context& loop)
      : timer_(loop, boost::asio::steady_timer::time_point::max()) {}
  void Set() {
    set_ = true;
    timer_.cancel();
  }
  boost::asio::awaitable<void> Wait();

 private:
  boost::asio::steady_timer timer_;
  bool set_ = false;
};

/// One client's connection, request after request. A read is always pending, so that a client that has gone
/// is noticed while it is being answered.
class Session : public std::enable_shared_from_this<Session> {
 public:
  using TimePoint = std::chrono::steady_clock::time_point;

  /// `busy`: not empty: why there is only room for a probe, which is one request to /healthz or /readyz;
  /// others are refused so.
  Session(std::shared_ptr<GatewayShared> shared, std::unique_ptr<Connection> connection, std::string peer,
          std::string busy = {});

  /// Until the connection has ended.
  boost::asio::awaitable<void> Run();
  void Close();
  void CloseIfLate(TimePoint now);
  /// Since when it has been waiting for a request; none: a request is being answered.
  std::optional<TimePoint> waiting_since() const { return waiting_since_; }

 private:
  using Outcome = boost::asio::awaitable<bool>;  // false: end the connection

  boost::asio::awaitable<void> ReadAll();
  boost::asio::awaitable<std::optional<HttpRequest>> NextRequest();
  boost::asio::awaitable<void> Linger();
  boost::asio::awaitable<bool> Write(std::string_view bytes);
  boost::asio::awaitable<void> WaitToSend(const std::string& method);
  void SetDeadline(std::chrono::milliseconds from_now);

  // What is given by reference outlives the answer.
  Outcome Answer(const HttpRequest& request);
  std::optional<HttpFailure> Objection(const HttpRequest& request) const;
  Outcome AnswerText(const HttpRequest& request, int status, std::string_view type, std::string text);
  Outcome AnswerPage(const HttpRequest& request, const std::string& path);
  Outcome AnswerFile(const HttpRequest& request, const std::string& path);
  Outcome AnswerCall(const HttpRequest& request, WebFormat format);
  Outcome Forward(GrpcCallRequest call_request, WebFormat format, const StreamedResponse& response);
  Result<GrpcCallRequest> ToCall(const HttpRequest& request, WebFormat format) const;

  // Constant after construction.
  const std::shared_ptr<GatewayShared> shared_;
  const std::unique_ptr<Connection> connection_;
  const std::string peer_;
  const std::string busy_;

  HttpRequestParser parser_;
  std::string input_;   // read, not parsed
  bool ended_ = false;  // nothing more will be read
  bool closed_ = false;
  Signal news_, room_;  // input_, ended_ or a call has something; input_ has room
  TimePoint deadline_ = TimePoint::max();
  std::optional<TimePoint> waiting_since_;
};

}  // namespace taclink::server
