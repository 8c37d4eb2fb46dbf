#include <fmt/format.h>

#include <chrono>
#include <cmath>
#include <numbers>
#include <optional>

#include "client/command/cli/units.h"
#include "client/command/live/accept_trials.h"

namespace taclink::command {
namespace {

constexpr uint64_t kBody = 90;
constexpr double kDiscM = 0.011;
// A load is on when its true force is that near to what was asked for, and has been for so long.
constexpr double kForceShare = 0.01, kRestS = 0.3, kMostWaitS = 30;
constexpr double kPressurePa = 20;  // a regulator's noise within

double NormOf(const v1::Vector3& v) {
  return std::hypot(v.x(), v.y(), v.z());
}

class Player final : public TrialOperator {
 public:
  Player(client::Client& connection, const v1::Link& link, std::optional<double> force_n)
      : connection_(connection), link_(link), force_n_(force_n) {}
  ~Player() override { static_cast<void>(connection_.Release(link_.name(), kBody)); }

  Result<TrialAnswer> Clear() override {
    const auto frame = Wait([](const v1::LinkFrame& now) { return now.simulation().contacts().empty(); },
                            "nothing touches the link");
    if (!frame) return frame.error();
    return WithPressure(*frame);
  }

  Result<TrialAnswer> SetCondition(const v1::AcceptanceTrial& trial) override {
    if (!trial.attitude().empty())
      return Error{ErrorCode::kUnsupported,
                   "the simulation cannot be brought into attitude '" + trial.attitude() + "'"};
    if (!trial.has_pressure_pa()) return TrialAnswer{};
    fmt::print("{:.2f} kPa\n", kKpaPerPascal * trial.pressure_pa());
    if (auto set = SetPressure(trial.pressure_pa()); !set) return set.error();
    const auto frame = Wait(
        [&](const v1::LinkFrame& now) {
          return std::abs(now.pressure().pressure_pa() - trial.pressure_pa()) < kPressurePa;
        },
        "the pressure is there");
    if (!frame) return frame.error();
    return TrialAnswer{};
  }

  Result<TrialAnswer> Load(const v1::AcceptanceTrial& trial) override {
    const double force_n = force_n_.value_or(trial.force_n());
    fmt::print("{:.2f} N at path {}, ring {}\n", force_n, trial.path(), trial.ring());
    const v1::MarkerGrid& markers = link_.model().markers();
    v1::PressRequest request;
    request.set_link(link_.name());
    request.set_body_id(kBody);
    request.set_shape(v1::BODY_SHAPE_DISC);
    request.set_diameter_m(kDiscM);
    request.set_angle_rad(markers.first_path_angle_rad() +
                          (trial.path() - 1) * 2 * std::numbers::pi / markers.paths());
    request.set_z_m(markers.ring_z_m(static_cast<int>(trial.ring()) - 1));
    request.set_force_n(force_n);
    if (auto pressed = connection_.Press(request); !pressed) return pressed.error();
    double true_n = 0;
    const auto frame = Wait(
        [&](const v1::LinkFrame& now) {
          true_n = 0;
          for (const auto& contact : now.simulation().contacts())
            if (contact.body_id() == kBody) true_n += NormOf(contact.force_n());
          return std::abs(true_n - force_n) < kForceShare * force_n;
        },
        "the load is on");
    if (!frame) return frame.error();
    auto answer = WithPressure(*frame);
    answer.reference.set_force_n(true_n);
    return answer;
  }

  Result<TrialAnswer> Release(const v1::AcceptanceTrial&) override {
    if (auto released = connection_.Release(link_.name(), kBody); !released) return released.error();
    return Clear();
  }

 private:
  // By the link's regulator, if it has one: then nothing else can set it.
  Result<void> SetPressure(double pressure_pa) {
    if (link_.has_regulator()) {
      v1::SetPressureRequest request;
      request.set_link(link_.name());
      request.set_pressure_pa(pressure_pa);
      const auto set = connection_.SetPressure(request);
      return set ? Result<void>() : set.error();
    }
    v1::SetScenePressureRequest request;
    request.set_link(link_.name());
    request.set_pressure_pa(pressure_pa);
    const auto set = connection_.SetScenePressure(request);
    return set ? Result<void>() : set.error();
  }

  // Of a simulated link without a sensor of its own the frames have the true pressure.
  static TrialAnswer WithPressure(const v1::LinkFrame& frame) {
    TrialAnswer answer;
    if (frame.pressure().origin() == v1::PRESSURE_ORIGIN_SIMULATED)
      answer.reference.set_pressure_pa(frame.pressure().pressure_pa());
    return answer;
  }

  // The first frame from which on `holds` has been true for kRestS.
  template <typename Holds>
  Result<v1::LinkFrame> Wait(const Holds& holds, const char* what) {
    v1::StreamFramesRequest request;
    request.add_links(link_.name());
    auto reader = connection_.StreamFrames(request);
    if (!reader) return reader.error();
    const auto begin = std::chrono::steady_clock::now();
    int64_t since_ns = 0;  // 0: it does not hold
    std::string trouble;
    while (std::chrono::steady_clock::now() - begin < std::chrono::duration<double>(kMostWaitS)) {
      const auto frame = (*reader)->Next(std::chrono::seconds(1));
      if (!frame && frame.error().code == ErrorCode::kTimeout) continue;
      if (!frame) return frame.error();
      trouble = frame->simulation().trouble();
      const int64_t now_ns = frame->times().exposure_ns();
      if (!holds(*frame)) {
        since_ns = 0;
      } else if (since_ns == 0) {
        since_ns = now_ns;
      } else if (1e-9 * static_cast<double>(now_ns - since_ns) > kRestS) {
        return *frame;
      }
    }
    return Error{ErrorCode::kTimeout, fmt::format("waited {:.0f} s until {}{}", kMostWaitS, what,
                                                  trouble.empty() ? "" : ": " + trouble)};
  }

  client::Client& connection_;
  const v1::Link link_;
  const std::optional<double> force_n_;
};

}  // namespace

std::unique_ptr<TrialOperator> MakePlayer(client::Client& connection, const v1::Link& link,
                                          std::optional<double> force_n) {
  return std::make_unique<Player>(connection, link, force_n);
}

}  // namespace taclink::command
