#include "tests/v4l2/usb_port.h"

#include <arpa/inet.h>
#include <fcntl.h>
#include <sys/socket.h>
#include <unistd.h>

#include <cerrno>
#include <cstring>

namespace taclink::testing {
namespace {

constexpr const char* kAttach = "/sys/devices/platform/vhci_hcd.0/attach";
constexpr int kHighSpeed = 3;  // enum usb_device_speed
constexpr uint32_t kSubmit = 1, kUnlink = 2, kSubmitted = 3, kUnlinked = 4;
constexpr size_t kMaxOut = 4096;

/// 48 bytes, big-endian: what all messages begin with, then what depends on the command.
struct Header {
  uint32_t command, id, device, direction, endpoint;
  std::array<uint32_t, 7> words;
};
static_assert(sizeof(Header) == 48);

Header Swapped(const Header& header) {
  Header out{};
  std::array<uint32_t, 12> words{};
  std::memcpy(words.data(), &header, sizeof header);
  for (uint32_t& word : words) word = htonl(word);
  std::memcpy(&out, words.data(), sizeof out);
  return out;
}

}  // namespace

std::string UsbPort::Plug(int port) {
  Unplug();
  std::array<int, 2> ends{};
  if (socketpair(AF_UNIX, SOCK_STREAM, 0, ends.data()) != 0) return std::strerror(errno);
  const int room = 4 << 20;
  setsockopt(ends[0], SOL_SOCKET, SO_SNDBUF, &room, sizeof room);
  const int attach = open(kAttach, O_WRONLY | O_CLOEXEC);
  const int device = port + 1;
  const std::string text = std::to_string(port) + " " + std::to_string(ends[1]) + " " +
                           std::to_string(device) + " " + std::to_string(kHighSpeed);
  const bool attached =
      attach >= 0 && write(attach, text.data(), text.size()) == static_cast<ssize_t>(text.size());
  const std::string why = attached ? "" : std::string(kAttach) + ": " + std::strerror(errno);
  if (attach >= 0) close(attach);
  close(ends[1]);
  if (!attached) {
    close(ends[0]);
    return why;
  }
  fd_ = ends[0];
  return "";
}

void UsbPort::Unplug() {
  if (fd_ < 0) return;
  shutdown(fd_, SHUT_RDWR);
  close(fd_);
  fd_ = -1;
}

bool UsbPort::Read(void* to, size_t size) const {
  auto* at = static_cast<uint8_t*>(to);
  while (size > 0) {
    const ssize_t got = recv(fd_, at, size, 0);
    if (got <= 0) return false;
    at += got;
    size -= static_cast<size_t>(got);
  }
  return true;
}

bool UsbPort::Write(const void* from, size_t size) const {
  const auto* at = static_cast<const uint8_t*>(from);
  while (size > 0) {
    const ssize_t put = send(fd_, at, size, MSG_NOSIGNAL);
    if (put <= 0) return false;
    at += put;
    size -= static_cast<size_t>(put);
  }
  return true;
}

std::optional<UsbRequest> UsbPort::Receive() {
  Header raw{};
  if (!Read(&raw, sizeof raw)) return std::nullopt;
  const Header header = Swapped(raw);
  UsbRequest request;
  request.unlink = header.command == kUnlink;
  request.id = request.unlink ? header.words[0] : header.id;
  request.answer = header.id;
  if (request.unlink) return request;
  if (header.command != kSubmit) return std::nullopt;
  request.endpoint = header.endpoint;
  request.in = header.direction != 0;
  request.length = header.words[1];
  std::memcpy(request.setup.data(), &raw.words[5], request.setup.size());  // bytes, not a number
  if (request.in || request.length == 0) return request;
  if (request.length > kMaxOut) return std::nullopt;
  request.data.resize(request.length);
  if (!Read(request.data.data(), request.data.size())) return std::nullopt;
  return request;
}

bool UsbPort::Answer(const UsbRequest& request, int status, std::span<const uint8_t> data, uint32_t taken) {
  const auto actual = request.in ? static_cast<uint32_t>(data.size()) : taken;
  const Header header = Swapped({.command = kSubmitted,
                                 .id = request.id,
                                 .device = 0,
                                 .direction = 0,
                                 .endpoint = 0,
                                 .words = {static_cast<uint32_t>(status), actual, 0, 0, 0, 0, 0}});
  if (!Write(&header, sizeof header)) return false;
  return !request.in || data.empty() || Write(data.data(), data.size());
}

bool UsbPort::AnswerUnlink(const UsbRequest& request, bool found) {
  const Header header =
      Swapped({.command = kUnlinked,
               .id = request.answer,
               .device = 0,
               .direction = 0,
               .endpoint = 0,
               .words = {static_cast<uint32_t>(found ? -ECONNRESET : 0), 0, 0, 0, 0, 0, 0}});
  return Write(&header, sizeof header);
}

}  // namespace taclink::testing
