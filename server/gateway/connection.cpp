#include "server/gateway/connection.h"

#include <openssl/ssl.h>
#include <openssl/x509.h>
#include <openssl/x509v3.h>

#include <algorithm>
#include <boost/asio/as_tuple.hpp>
#include <boost/asio/buffer.hpp>
#include <boost/asio/ssl/stream.hpp>
#include <boost/asio/use_awaitable.hpp>
#include <boost/asio/write.hpp>
#include <utility>

#include "server/process/send_delay.h"

namespace taclink::server {
namespace {

namespace asio = boost::asio;
using asio::ip::tcp;

constexpr auto kAwaitTransfer = asio::as_tuple(asio::use_awaitable);

template <typename Stream>
asio::awaitable<size_t> ReadSome(Stream& stream, std::span<char> place) {
  const auto [error, size] =
      co_await stream.async_read_some(asio::buffer(place.data(), place.size()), kAwaitTransfer);
  co_return error ? 0 : size;
}

template <typename Stream>
asio::awaitable<bool> WriteAll(Stream& stream, std::string_view bytes) {
  const auto [error, size] =
      co_await asio::async_write(stream, asio::buffer(bytes.data(), bytes.size()), kAwaitTransfer);
  co_return !error && size == bytes.size();
}

void CloseSocket(tcp::socket& socket) {
  boost::system::error_code ignored;
  socket.close(ignored);
}

void EndSocket(tcp::socket& socket) {
  boost::system::error_code ignored;
  socket.shutdown(tcp::socket::shutdown_send, ignored);
}

std::string Utf8(const ASN1_STRING* text) {
  unsigned char* bytes = nullptr;
  const int size = ASN1_STRING_to_UTF8(&bytes, text);
  std::string out(reinterpret_cast<const char*>(bytes), static_cast<size_t>(std::max(size, 0)));
  OPENSSL_free(bytes);
  return out;
}

// The first alternative name that is a text; empty: none.
std::string AlternativeName(const X509& certificate) {
  auto* const names =
      static_cast<GENERAL_NAMES*>(X509_get_ext_d2i(&certificate, NID_subject_alt_name, nullptr, nullptr));
  std::string out;
  for (int i = 0; out.empty() && i < sk_GENERAL_NAME_num(names); ++i) {
    const GENERAL_NAME* const name = sk_GENERAL_NAME_value(names, i);
    if (name->type == GEN_DNS || name->type == GEN_EMAIL || name->type == GEN_URI) out = Utf8(name->d.ia5);
  }
  GENERAL_NAMES_free(names);
  return out;
}

// As server/rpc/requests/who.cpp takes it of a call over gRPC.
std::string NameOfPeer(const SSL* ssl) {
  const std::unique_ptr<X509, decltype(&X509_free)> certificate(SSL_get1_peer_certificate(ssl), X509_free);
  if (!certificate) return {};
  const X509_NAME* const subject = X509_get_subject_name(certificate.get());
  const int at = X509_NAME_get_index_by_NID(subject, NID_commonName, -1);
  const std::string common_name =
      at < 0 ? std::string() : Utf8(X509_NAME_ENTRY_get_data(X509_NAME_get_entry(subject, at)));
  return common_name.empty() ? AlternativeName(*certificate) : common_name;
}

class PlainConnection final : public Connection {
 public:
  explicit PlainConnection(tcp::socket socket) : socket_(std::move(socket)) {}
  asio::awaitable<bool> Handshake() override { co_return true; }
  std::string ClientName() override { return {}; }
  asio::awaitable<size_t> Read(std::span<char> place) override { return ReadSome(socket_, place); }
  asio::awaitable<bool> Write(std::string_view bytes) override { return WriteAll(socket_, bytes); }
  std::chrono::milliseconds SendDelay() override { return server::SendDelay(socket_.native_handle()); }
  void EndWriting() override { EndSocket(socket_); }
  void Close() override { CloseSocket(socket_); }

 private:
  tcp::socket socket_;
};

class TlsConnection final : public Connection {
 public:
  TlsConnection(tcp::socket socket, std::shared_ptr<asio::ssl::context> tls)
      : tls_(std::move(tls)), stream_(std::move(socket), *tls_) {}
  asio::awaitable<bool> Handshake() override {
    const auto [error] = co_await stream_.async_handshake(asio::ssl::stream_base::server, kAwaitTransfer);
    co_return !error;
  }
  std::string ClientName() override { return NameOfPeer(stream_.native_handle()); }
  asio::awaitable<size_t> Read(std::span<char> place) override { return ReadSome(stream_, place); }
  asio::awaitable<bool> Write(std::string_view bytes) override { return WriteAll(stream_, bytes); }
  std::chrono::milliseconds SendDelay() override {
    return server::SendDelay(stream_.next_layer().native_handle());
  }
  void EndWriting() override { EndSocket(stream_.next_layer()); }
  void Close() override { CloseSocket(stream_.next_layer()); }

 private:
  const std::shared_ptr<asio::ssl::context> tls_;
  asio::ssl::stream<tcp::socket> stream_;
};

}  // namespace

std::unique_ptr<Connection> MakeConnection(tcp::socket socket, std::shared_ptr<asio::ssl::context> tls) {
  if (!tls) return std::make_unique<PlainConnection>(std::move(socket));
  return std::make_unique<TlsConnection>(std::move(socket), std::move(tls));
}

}  // namespace taclink::server
