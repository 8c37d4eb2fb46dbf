#pragma once

#include <array>
#include <cstdint>
#include <optional>
#include <span>
#include <string>
#include <vector>

namespace taclink::testing {

/// What the kernel asks of a USB device: a transfer, or to forget one (unlink).
struct UsbRequest {
  bool unlink = false;
  uint32_t id = 0;      ///< for the answer; of an unlink: of the request to forget
  uint32_t answer = 0;  ///< of an unlink: its own id
  uint32_t endpoint = 0;
  bool in = false;                 ///< device to host
  uint32_t length = 0;             ///< room for data in, or length of `data`
  std::array<uint8_t, 8> setup{};  ///< of a control transfer
  std::vector<uint8_t> data;       ///< of an out transfer
};

/// A port of the kernel's virtual USB hub (vhci_hcd), which a device of this process is plugged into. Speaks
/// USB/IP over a socket pair (the kernel's Documentation/usb/usbip_protocol.rst); high speed. One thread.
class UsbPort {
 public:
  UsbPort() = default;
  ~UsbPort() { Unplug(); }
  UsbPort(const UsbPort&) = delete;
  UsbPort& operator=(const UsbPort&) = delete;

  /// Empty: done; else what failed.
  std::string Plug(int port);
  void Unplug();
  bool plugged() const { return fd_ >= 0; }
  int fd() const { return fd_; }

  /// Blocks for the next request. None: the kernel has closed the port.
  std::optional<UsbRequest> Receive();
  /// `data` is what an in-transfer brought, `taken` how much of an out-transfer was used.
  bool Answer(const UsbRequest& request, int status, std::span<const uint8_t> data, uint32_t taken = 0);
  bool AnswerUnlink(const UsbRequest& request, bool found);

 private:
  bool Read(void* to, size_t size) const;
  bool Write(const void* from, size_t size) const;

  int fd_ = -1;
};

}  // namespace taclink::testing
