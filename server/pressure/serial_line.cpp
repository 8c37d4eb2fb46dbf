#include "server/pressure/serial_line.h"

#include <fcntl.h>
#include <sys/ioctl.h>
#include <termios.h>
#include <unistd.h>

#include <array>
#include <cerrno>
#include <cstring>

#include "server/config/regulator_options.h"

namespace taclink::server {
namespace {

// In the order of kBaudRates.
constexpr std::array<speed_t, kBaudRates.size()> kSpeeds = {B1200,  B2400,  B4800,   B9600,   B19200,
                                                            B38400, B57600, B115200, B230400, B921600};

speed_t SpeedOf(int baud) {
  for (size_t i = 0; i < kBaudRates.size(); ++i)
    if (kBaudRates[i] == baud) return kSpeeds[i];
  return B9600;
}

bool SetUp(int descriptor, int baud, SerialAccess access) {
  termios settings{};
  if (tcgetattr(descriptor, &settings) != 0) return false;
  cfmakeraw(&settings);
  settings.c_cflag |= CLOCAL | CREAD;
  settings.c_cflag &= ~static_cast<tcflag_t>(CSTOPB | CRTSCTS);
  if (cfsetspeed(&settings, SpeedOf(baud)) != 0 || tcsetattr(descriptor, TCSANOW, &settings) != 0)
    return false;
  return access == SerialAccess::kRead || ioctl(descriptor, TIOCEXCL) == 0;
}

}  // namespace

Result<int> OpenSerialLine(const std::string& device, int baud, SerialAccess access) {
  const int mode = access == SerialAccess::kRead ? O_RDONLY : O_RDWR;
  const int descriptor = open(device.c_str(), mode | O_NOCTTY | O_NONBLOCK | O_CLOEXEC);
  if (descriptor >= 0 && SetUp(descriptor, baud, access)) return descriptor;
  const int error = errno;
  if (descriptor >= 0) close(descriptor);
  return Error{ErrorCode::kUnavailable, device + ": cannot be opened: " + std::strerror(error)};
}

}  // namespace taclink::server
