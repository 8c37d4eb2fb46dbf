#include "server/simulation/regulated_air.h"

#include <algorithm>
#include <cmath>
#include <limits>

namespace taclink::server {
namespace {

// The solution of dp/dt = drift - rate p after span_s.
double Relaxed(double kpa, double drift, double rate, double span_s) {
  if (rate == 0) return kpa + drift * span_s;
  return kpa * std::exp(-rate * span_s) - drift / rate * std::expm1(-rate * span_s);
}

// Time at which that solution reaches a pressure; infinite: never.
double TimeTo(double to_kpa, double kpa, double drift, double rate) {
  constexpr double kNever = std::numeric_limits<double>::infinity();
  double span_s = kNever;
  if (rate == 0) {
    if (drift != 0) span_s = (to_kpa - kpa) / drift;
  } else {
    const double left = (to_kpa - drift / rate) / (kpa - drift / rate);
    if (left > 0) span_s = -std::log(left) / rate;
  }
  return span_s >= 0 ? span_s : kNever;
}

}  // namespace

double RegulatedAir::Feed() const {
  const double slew = options_.slew_kpa_per_s;
  return std::clamp((commanded_kpa_ - kpa_) / options_.time_constant_s, -slew, slew);
}

double RegulatedAir::kpa_per_s() const {
  return Feed() - leak_per_s() * kpa_;
}

double RegulatedAir::effort() const {
  return std::abs(Feed()) / options_.slew_kpa_per_s;
}

void RegulatedAir::Advance(double span_s) {
  const double tau = options_.time_constant_s, slew = options_.slew_kpa_per_s, leak = leak_per_s();
  const double away_kpa = commanded_kpa_ - kpa_;
  if (std::abs(away_kpa) > slew * tau) {
    // The valve is at its limit until the pressure is close enough to the commanded one.
    const double drift = std::copysign(slew, away_kpa);
    const double near_kpa = commanded_kpa_ - std::copysign(slew * tau, away_kpa);
    const double until_s = TimeTo(near_kpa, kpa_, drift, leak);
    if (until_s >= span_s) {
      kpa_ = Relaxed(kpa_, drift, leak, span_s);
      return;
    }
    kpa_ = near_kpa;
    span_s -= until_s;
  }
  // Within the valve's range, until a leak beyond the valve's capacity draws the pressure out of it.
  const double lowest_kpa = commanded_kpa_ - slew * tau;
  if (commanded_kpa_ / (1 + leak * tau) < lowest_kpa) {
    const double until_s = TimeTo(lowest_kpa, kpa_, commanded_kpa_ / tau, 1 / tau + leak);
    if (until_s < span_s) {
      kpa_ = Relaxed(lowest_kpa, slew, leak, span_s - until_s);
      return;
    }
  }
  kpa_ = Relaxed(kpa_, commanded_kpa_ / tau, 1 / tau + leak, span_s);
}

}  // namespace taclink::server
