#include <fcntl.h>
#include <fmt/format.h>
#include <poll.h>
#include <termios.h>
#include <unistd.h>

#include <cerrno>
#include <charconv>
#include <chrono>
#include <cmath>
#include <cstdio>
#include <cstring>
#include <iostream>
#include <utility>

#include "client/command/cli/interrupt.h"
#include "client/command/cli/units.h"
#include "client/command/live/accept_trials.h"

namespace taclink::command {
namespace {

using Kind = TrialAnswer::Kind;

constexpr double kNewtonPerGram = 9.80665e-3;

std::optional<double> NumberOf(const std::string& text) {
  double value = 0;
  const auto [end, error] = std::from_chars(text.data(), text.data() + text.size(), value);
  if (error != std::errc() || end != text.data() + text.size() || !std::isfinite(value)) return std::nullopt;
  return value;
}

std::optional<speed_t> GaugeSpeed(int baud) {
  constexpr std::pair<int, speed_t> kSpeeds[] = {{1200, B1200},   {2400, B2400},     {4800, B4800},
                                                 {9600, B9600},   {19200, B19200},   {38400, B38400},
                                                 {57600, B57600}, {115200, B115200}, {230400, B230400}};
  for (const auto& [rate, speed] : kSpeeds) {
    if (rate == baud) return speed;
  }
  return std::nullopt;
}

/// A force gauge that sends a number a line.
class Gauge {
 public:
  explicit Gauge(const PersonOptions& options) : options_(options) {}

  /// The mean of the numbers that come within a second. Errors: kUnavailable (no device, none come).
  Result<double> ReadN() const {
    const int device = ::open(options_.gauge.c_str(), O_RDONLY | O_NOCTTY | O_NONBLOCK | O_CLOEXEC);
    if (device < 0) return Failed(std::strerror(errno));
    termios settings{};
    if (::tcgetattr(device, &settings) == 0) {
      cfmakeraw(&settings);
      settings.c_cflag |= CLOCAL | CREAD;
      ::cfsetspeed(&settings, *GaugeSpeed(options_.gauge_baud));
      ::tcsetattr(device, TCSANOW, &settings);
    }
    const std::string text = TextOf(device);
    ::close(device);
    double sum = 0;
    int numbers = 0;
    // The first and the last line may be pieces.
    for (size_t begin = text.find('\n'); begin != std::string::npos;) {
      const size_t end = text.find('\n', begin + 1);
      if (end == std::string::npos) break;
      std::string line = text.substr(begin + 1, end - begin - 1);
      std::erase_if(line, [](char c) { return c == '\r' || c == ' ' || c == '+'; });
      if (const auto value = NumberOf(line)) {
        sum += *value;
        ++numbers;
      }
      begin = end;
    }
    if (numbers == 0) return Failed("sends no numbers, one a line; check the device and --gauge-baud");
    return options_.gauge_n_per_unit * sum / numbers;
  }

 private:
  Error Failed(const std::string& what) const {
    return {ErrorCode::kUnavailable, "force gauge " + options_.gauge + ": " + what};
  }

  // What comes within a second.
  static std::string TextOf(int device) {
    using Clock = std::chrono::steady_clock;
    const auto end = Clock::now() + std::chrono::seconds(1);
    std::string text;
    for (;;) {
      const auto left = std::chrono::ceil<std::chrono::milliseconds>(end - Clock::now()).count();
      if (left <= 0) return text;
      pollfd waiting{.fd = device, .events = POLLIN, .revents = 0};
      if (::poll(&waiting, 1, static_cast<int>(left)) <= 0) continue;
      char piece[1024];
      const ssize_t got = ::read(device, piece, sizeof piece);
      if (got == 0 || (got < 0 && errno != EAGAIN && errno != EINTR)) return text;  // the device is gone
      if (got > 0) text.append(piece, static_cast<size_t>(got));
    }
  }

  const PersonOptions& options_;
};

class Person final : public TrialOperator {
 public:
  explicit Person(const PersonOptions& options) : options_(options) {}

  Result<TrialAnswer> Clear() override {
    auto answer = Ask("Nothing may touch the link", false);
    if (answer && manometer_pa_) answer->reference.set_pressure_pa(*manometer_pa_);
    return answer;
  }

  Result<TrialAnswer> SetCondition(const v1::AcceptanceTrial& trial) override {
    manometer_pa_.reset();
    std::string what;
    if (!trial.attitude().empty()) what = "bring the link into the attitude '" + trial.attitude() + "'";
    if (trial.has_pressure_pa())
      what += fmt::format("{}set the pressure to {:.2f} kPa", what.empty() ? "" : " and ",
                          kKpaPerPascal * trial.pressure_pa());
    if (what.empty()) return TrialAnswer{};
    what[0] = static_cast<char>(std::toupper(what[0]));
    auto answer =
        Ask(what + (trial.has_pressure_pa() ? "; a number: what a manometer shows, kPa" : ""), true);
    if (answer && number_) manometer_pa_ = *number_ / kKpaPerPascal;
    return answer;
  }

  Result<TrialAnswer> Load(const v1::AcceptanceTrial& trial) override {
    const double force_n = options_.force_n.value_or(trial.force_n());
    std::string what = fmt::format("Put {:.3f} N ({:.1f} g)", force_n, force_n / kNewtonPerGram);
    if (!options_.gauge.empty()) what = fmt::format("Press with the gauge, about {:.2f} N,", force_n);
    if (trial.path() > 0)
      what += fmt::format(" on the marker at path {}, ring {}", trial.path(), trial.ring());
    auto answer = Ask(what + (options_.gauge.empty() ? "; a number: its force, N" : ""), true);
    if (!answer || answer->kind != Kind::kReady) return answer;
    v1::TrialReference& reference = answer->reference;
    reference.set_force_n(number_.value_or(force_n));
    if (manometer_pa_) reference.set_pressure_pa(*manometer_pa_);
    if (options_.gauge.empty()) return answer;
    const auto gauge_n = Gauge(options_).ReadN();
    if (!gauge_n) return gauge_n.error();
    reference.set_force_n(std::abs(*gauge_n));
    fmt::print("  the gauge shows {:.3f} N\n", std::abs(*gauge_n));
    return answer;
  }

  Result<TrialAnswer> Release(const v1::AcceptanceTrial&) override { return Ask("  Take it off", false); }

 private:
  // Waits for a line: empty: done; a number, where one is asked for; s: skip; r: repeat; q or the end of
  // input: stop.
  Result<TrialAnswer> Ask(const std::string& what, bool takes_number) {
    number_.reset();
    for (;;) {
      fmt::print("{}. Enter when done (s skips, r repeats the one before, q stops): ", what);
      std::fflush(stdout);
      std::string line;
      if (!std::getline(std::cin, line)) return TrialAnswer{.kind = Kind::kStop, .reference = {}};
      if (line.empty()) return TrialAnswer{};
      if (line == "s") return TrialAnswer{.kind = Kind::kSkip, .reference = {}};
      if (line == "r") return TrialAnswer{.kind = Kind::kRepeat, .reference = {}};
      if (line == "q") return TrialAnswer{.kind = Kind::kStop, .reference = {}};
      number_ = NumberOf(line);
      if (takes_number && number_ && *number_ >= 0) return TrialAnswer{};
      fmt::print("  '{}' is not {}\n", line, takes_number ? "a number from 0 on, s, r or q" : "s, r or q");
    }
  }

  const PersonOptions options_;
  std::optional<double> number_;        // of the last answer
  std::optional<double> manometer_pa_;  // for the trials under this condition
};

}  // namespace

Result<std::unique_ptr<TrialOperator>> MakePerson(const PersonOptions& options) {
  if (!GaugeSpeed(options.gauge_baud)) {
    return Error{ErrorCode::kInvalidArgument,
                 fmt::format("--gauge-baud {} is no rate of serial lines; usual are 9600 and 115200",
                             options.gauge_baud)};
  }
  return std::unique_ptr<TrialOperator>(std::make_unique<Person>(options));
}

}  // namespace taclink::command
