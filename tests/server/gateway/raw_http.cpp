#include "tests/server/gateway/raw_http.h"

#include <arpa/inet.h>
#include <gtest/gtest.h>
#include <netinet/in.h>
#include <sys/socket.h>
#include <sys/time.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <cerrno>

#include "tests/server/support.h"

namespace taclink::server {

RawHttp::RawHttp(const std::string& address, const char* from) : socket_(socket(AF_INET, SOCK_STREAM, 0)) {
  sockaddr_in to{};
  to.sin_family = AF_INET;
  to.sin_port = htons(static_cast<uint16_t>(std::stoi(address.substr(address.rfind(':') + 1))));
  to.sin_addr.s_addr = htonl(INADDR_LOOPBACK);
  const timeval forever{.tv_sec = kForever.count(), .tv_usec = 0};
  setsockopt(socket_, SOL_SOCKET, SO_RCVTIMEO, &forever, sizeof forever);
  sockaddr_in own{};
  own.sin_family = AF_INET;
  EXPECT_EQ(inet_pton(AF_INET, from, &own.sin_addr), 1);
  EXPECT_EQ(bind(socket_, reinterpret_cast<const sockaddr*>(&own), sizeof own), 0) << from;
  EXPECT_EQ(connect(socket_, reinterpret_cast<const sockaddr*>(&to), sizeof to), 0) << address;
}

RawHttp::~RawHttp() {
  Close();
}

void RawHttp::Close() {
  if (socket_ >= 0) close(socket_);
  socket_ = -1;
}

void RawHttp::EndWriting() {
  shutdown(socket_, SHUT_WR);
}

void RawHttp::Send(std::string_view bytes) {
  while (!bytes.empty()) {
    const ssize_t sent = send(socket_, bytes.data(), bytes.size(), MSG_NOSIGNAL);
    if (sent <= 0) return;  // the server has closed; Read shows what it said before
    bytes.remove_prefix(static_cast<size_t>(sent));
  }
}

bool RawHttp::Fill() {
  std::array<char, 65536> block{};
  const ssize_t size = recv(socket_, block.data(), block.size(), 0);
  if (size < 0 && (errno == EAGAIN || errno == EWOULDBLOCK))
    ADD_FAILURE() << "the server neither speaks nor closes";
  if (size <= 0) return false;
  input_.append(block.data(), static_cast<size_t>(size));
  return true;
}

std::optional<std::string> RawHttp::TakeLine() {
  size_t end = 0;
  while ((end = input_.find("\r\n")) == std::string::npos) {
    if (!Fill()) return std::nullopt;
  }
  std::string line = input_.substr(0, end);
  input_.erase(0, end + 2);
  return line;
}

bool RawHttp::TakeBytes(size_t count, std::string& out) {
  while (input_.size() < count) {
    if (!Fill()) return false;
  }
  out += input_.substr(0, count);
  input_.erase(0, count);
  return true;
}

RawResponse RawHttp::ReadHead() {
  RawResponse response;
  auto line = TakeLine();
  if (!line || !line->starts_with("HTTP/1.1 ")) return response;
  const int status = std::stoi(line->substr(9));
  while ((line = TakeLine()) && !line->empty()) {
    const auto colon = line->find(": ");
    std::string name = line->substr(0, colon);
    std::transform(name.begin(), name.end(), name.begin(), [](unsigned char c) { return std::tolower(c); });
    response.headers[name] = line->substr(colon + 2);
  }
  if (line) response.status = status;
  return response;
}

std::optional<std::string> RawHttp::ReadChunk() {
  const auto head = TakeLine();
  if (!head) return std::nullopt;
  const size_t size = std::stoul(*head, nullptr, 16);
  std::string chunk, end;
  if (!TakeBytes(size, chunk) || !TakeBytes(2, end) || size == 0) return std::nullopt;
  return chunk;
}

RawResponse RawHttp::Read(bool has_body) {
  RawResponse response = ReadHead();
  if (response.status == 0 || !has_body) return response;
  if (response.headers.contains("transfer-encoding")) {
    while (const auto chunk = ReadChunk()) response.body += *chunk;
  } else {
    EXPECT_TRUE(TakeBytes(std::stoul(response.headers["content-length"]), response.body));
  }
  return response;
}

std::string RawHttp::ReadToEnd() {
  while (Fill()) {
  }
  return input_;
}

RawResponse Ask(const std::string& address, const std::string& text) {
  RawHttp connection(address);
  connection.Send(text);
  return connection.Read();
}

RawResponse Get(const std::string& address, const std::string& target, const std::string& more_headers) {
  return Ask(address, "GET " + target + " HTTP/1.1\r\nHost: localhost\r\n" + more_headers + "\r\n");
}

}  // namespace taclink::server
