#pragma once

#include <boost/asio/awaitable.hpp>
#include <boost/asio/ip/tcp.hpp>
#include <boost/asio/ssl/context.hpp>
#include <chrono>
#include <memory>
#include <span>
#include <string>
#include <string_view>

namespace taclink::server {

/// A client's socket, plain or within TLS. One Read and one Write at a time; one thread.
class Connection {
 public:
  virtual ~Connection() = default;
  /// False: it failed; close it.
  virtual boost::asio::awaitable<bool> Handshake() = 0;
  /// Of the client's certificate, its first common name, else its first alternative name; empty: it showed
  /// none.
  virtual std::string ClientName() = 0;
  /// 0: the client sends no more, or has gone.
  virtual boost::asio::awaitable<size_t> Read(std::span<char> place) = 0;
  /// All of it. False: the client has gone.
  virtual boost::asio::awaitable<bool> Write(std::string_view bytes) = 0;
  /// Of the socket, as server/process/send_delay.h.
  virtual std::chrono::milliseconds SendDelay() = 0;
  /// Tells the client that nothing follows.
  virtual void EndWriting() = 0;
  /// Ends what is under way.
  virtual void Close() = 0;
};

/// `tls` null: plain.
std::unique_ptr<Connection> MakeConnection(boost::asio::ip::tcp::socket socket,
                                           std::shared_ptr<boost::asio::ssl::context> tls);

}  // namespace taclink::server
