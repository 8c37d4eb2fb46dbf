#include "server/pressure/serial_regulator.h"

#include <fmt/format.h>

#include <algorithm>
#include <string_view>
#include <utility>

#include "server/pressure/line_reader.h"
#include "server/pressure/serial_line.h"

namespace taclink::server {
namespace {

constexpr size_t kLongestQuote = 80;

// A device may send anything: only printable ASCII reaches logs and clients.
std::string Quotable(std::string_view text) {
  std::string out(text.substr(0, kLongestQuote));
  for (char& c : out) c = c >= ' ' && c <= '~' ? c : '?';
  return out;
}

std::string_view WithoutBlanks(std::string_view text) {
  const auto first = text.find_first_not_of(" \t\r");
  if (first == std::string_view::npos) return {};
  return text.substr(first, text.find_last_not_of(" \t\r") - first + 1);
}

class SerialRegulator final : public PressureActuator {
 public:
  SerialRegulator(std::string device, int baud, Clock& clock)
      : device_(std::move(device)), baud_(baud), clock_(clock) {}

  Result<void> Open() override {
    lines_ = LineReader();
    const auto descriptor = OpenSerialLine(device_, baud_, SerialAccess::kReadWrite);
    if (!descriptor) return descriptor.error();
    lines_ = LineReader(*descriptor);
    return {};
  }

  Result<void> Command(std::optional<double> kpa) override {
    const auto sent = lines_.Write(kpa ? fmt::format("P {:.4f}\n", *kpa) : std::string("V\n"));
    if (sent) return {};
    return Error{sent.error().code, device_ + ": " + sent.error().message};
  }

  Result<RegulatorReading> Read(std::chrono::milliseconds timeout) override {
    const auto line = lines_.NextInTurn(timeout);
    if (!line) {
      if (line.error().code == ErrorCode::kTimeout) return line.error();
      return Error{line.error().code, device_ + ": " + line.error().message};
    }
    const std::string_view text = WithoutBlanks(*line);
    if (text.starts_with("e"))
      return Error{ErrorCode::kFailedPrecondition,
                   device_ + ": the regulator reports: " + Quotable(WithoutBlanks(text.substr(1)))};
    const auto reading = ParseReading(text);
    if (reading) return *reading;
    return Error{ErrorCode::kInvalidArgument,
                 device_ + ": '" + Quotable(text) + "' is not a message of a regulator (docs/pressure.md)"};
  }

 private:
  std::optional<RegulatorReading> ParseReading(std::string_view text) const {
    if (!text.starts_with("p ")) return std::nullopt;
    text = WithoutBlanks(text.substr(2));
    const auto blank = text.find_first_of(" \t");
    const auto kpa = NumberOfLine(text.substr(0, blank));
    if (!kpa) return std::nullopt;
    RegulatorReading reading{.time_ns = clock_.MonotonicNs(), .kpa = *kpa};
    if (blank == std::string_view::npos) return reading;
    const auto effort = NumberOfLine(text.substr(blank));
    if (!effort) return std::nullopt;
    // An effort out of range is clamped: the pressure is still valid.
    reading.effort = std::clamp(*effort, 0.0, 1.0);
    return reading;
  }

  // Constant after construction.
  const std::string device_;
  const int baud_;
  Clock& clock_;

  LineReader lines_;
};

}  // namespace

std::unique_ptr<PressureActuator> MakeSerialRegulator(std::string device, int baud, Clock& clock) {
  return std::make_unique<SerialRegulator>(std::move(device), baud, clock);
}

}  // namespace taclink::server
