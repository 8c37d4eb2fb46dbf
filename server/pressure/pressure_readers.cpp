#include "server/pressure/pressure_readers.h"

#include <fcntl.h>
#include <sys/stat.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <cerrno>
#include <cstring>
#include <utility>

#include "server/pressure/line_reader.h"
#include "server/pressure/serial_line.h"

namespace taclink::server {
namespace {

using std::chrono::milliseconds;

Error Unavailable(const std::string& path, const std::string& what) {
  return {ErrorCode::kUnavailable, path + ": " + what};
}

Error NoNumber(const std::string& path, std::string line) {
  line.resize(std::min<size_t>(line.size(), 40));
  for (char& c : line) c = c >= ' ' && c <= '~' ? c : '?';
  return {ErrorCode::kInvalidArgument, path + ": '" + line + "' is no number"};
}

/// A number a line, of the moment it arrives.
class LinePressureReader : public PressureReader {
 public:
  LinePressureReader(std::string path, Clock& clock) : path_(std::move(path)), clock_(clock) {}

  Result<void> Open() override {
    lines_ = LineReader();
    const auto descriptor = OpenDescriptor();
    if (!descriptor) return descriptor.error();
    lines_ = LineReader(*descriptor);
    return {};
  }

  Result<RawReading> Read(milliseconds timeout) override {
    const auto line = lines_.Next(timeout);
    if (!line) {
      if (line.error().code == ErrorCode::kTimeout) return line.error();
      return Unavailable(path_, line.error().message);
    }
    const auto number = NumberOfLine(*line);
    if (!number) return NoNumber(path_, *line);
    return RawReading{*number, clock_.MonotonicNs()};
  }

 protected:
  virtual Result<int> OpenDescriptor() = 0;

  // Constant after construction.
  const std::string path_;
  Clock& clock_;

 private:
  LineReader lines_;
};

class SerialPressureReader final : public LinePressureReader {
 public:
  SerialPressureReader(std::string device, int baud, Clock& clock)
      : LinePressureReader(std::move(device), clock), baud_(baud) {}

 private:
  Result<int> OpenDescriptor() override { return OpenSerialLine(path_, baud_, SerialAccess::kRead); }

  const int baud_;
};

class PipePressureReader final : public LinePressureReader {
 public:
  using LinePressureReader::LinePressureReader;

 private:
  // Also for writing: else its end is reached whenever a writer goes.
  Result<int> OpenDescriptor() override {
    const int descriptor = open(path_.c_str(), O_RDWR | O_NONBLOCK | O_CLOEXEC);
    if (descriptor >= 0) return descriptor;
    return Unavailable(path_, std::string("cannot be opened: ") + std::strerror(errno));
  }
};

/// The last line of a regular file, looked at from time to time.
class WholeFileReader final : public PressureReader {
 public:
  WholeFileReader(std::string path, Clock& clock) : path_(std::move(path)), clock_(clock) {}

  Result<void> Open() override {
    if (access(path_.c_str(), R_OK) != 0)
      return Unavailable(path_, std::string("cannot be opened: ") + std::strerror(errno));
    return {};
  }

  Result<RawReading> Read(milliseconds timeout) override {
    struct stat now{};
    if (stat(path_.c_str(), &now) != 0) return Unavailable(path_, std::strerror(errno));
    const int64_t changed_ns = int64_t{now.st_mtim.tv_sec} * 1'000'000'000 + now.st_mtim.tv_nsec;
    if (changed_ns == changed_ns_) {
      const milliseconds pause = std::min(timeout, kLook);
      clock_.SleepUntilMonotonicNs(clock_.MonotonicNs() + std::chrono::nanoseconds(pause).count());
      return Error{ErrorCode::kTimeout, "the file has not changed"};
    }
    const auto line = LastLine(now.st_size);
    if (!line) return line.error();
    changed_ns_ = changed_ns;
    const auto number = NumberOfLine(*line);
    if (!number) return NoNumber(path_, *line);
    return RawReading{*number, clock_.MonotonicNs() - (clock_.UtcNs() - changed_ns)};
  }

 private:
  static constexpr milliseconds kLook{20};

  Result<std::string> LastLine(off_t size) const {
    const int descriptor = open(path_.c_str(), O_RDONLY | O_NONBLOCK | O_CLOEXEC);
    if (descriptor < 0) return Unavailable(path_, std::strerror(errno));
    std::array<char, 512> buffer{};
    const auto want = static_cast<off_t>(buffer.size());
    const ssize_t got = pread(descriptor, buffer.data(), buffer.size(), std::max<off_t>(0, size - want));
    close(descriptor);
    if (got < 0) return Unavailable(path_, std::strerror(errno));
    std::string text(buffer.data(), static_cast<size_t>(got));
    const auto end = text.find_last_not_of(" \t\r\n");
    if (end == std::string::npos) return std::string();
    text.resize(end + 1);
    const auto begin = text.find_last_of('\n');
    return begin == std::string::npos ? text : text.substr(begin + 1);
  }

  // Constant after construction.
  const std::string path_;
  Clock& clock_;

  int64_t changed_ns_ = -1;  // of what was read last
};

/// Which of the two it is shows when it is there.
class FilePressureReader final : public PressureReader {
 public:
  FilePressureReader(std::string path, Clock& clock) : path_(std::move(path)), clock_(clock) {}

  Result<void> Open() override {
    struct stat found{};
    if (stat(path_.c_str(), &found) != 0) return Unavailable(path_, std::strerror(errno));
    if (S_ISFIFO(found.st_mode)) {
      reader_ = std::make_unique<PipePressureReader>(path_, clock_);
    } else if (S_ISREG(found.st_mode)) {
      reader_ = std::make_unique<WholeFileReader>(path_, clock_);
    } else {
      return Unavailable(path_, "is neither a file nor a named pipe; a serial device needs 'source: serial'");
    }
    return reader_->Open();
  }
  Result<RawReading> Read(milliseconds timeout) override { return reader_->Read(timeout); }

 private:
  // Constant after construction.
  const std::string path_;
  Clock& clock_;

  std::unique_ptr<PressureReader> reader_;
};

}  // namespace

std::unique_ptr<PressureReader> MakeFilePressureReader(std::string path, Clock& clock) {
  return std::make_unique<FilePressureReader>(std::move(path), clock);
}

std::unique_ptr<PressureReader> MakeSerialPressureReader(std::string device, int baud, Clock& clock) {
  return std::make_unique<SerialPressureReader>(std::move(device), baud, clock);
}

}  // namespace taclink::server
