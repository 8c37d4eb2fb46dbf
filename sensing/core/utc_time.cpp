#include "sensing/core/utc_time.h"

#include <charconv>
#include <chrono>
#include <cstdio>

namespace taclink {
namespace {

// All of `text`, which is digits only. Negative: it is not.
int Digits(std::string_view text) {
  int number = -1;
  const auto [end, error] = std::from_chars(text.data(), text.data() + text.size(), number);
  return error == std::errc() && end == text.data() + text.size() ? number : -1;
}

}  // namespace

std::optional<int64_t> ParseUtc(std::string_view text) {
  using namespace std::chrono;
  constexpr std::string_view kForm = "YYYY-MM-DDThh:mm:ssZ";
  constexpr size_t kDate = 10;
  if (text.size() != kDate && text.size() != kForm.size()) return std::nullopt;
  for (size_t i = 0; i < text.size(); ++i) {
    const bool mark = std::string_view("-T:Z").find(kForm[i]) != std::string_view::npos;
    if (mark ? text[i] != kForm[i] : text[i] < '0' || text[i] > '9') return std::nullopt;
  }
  const year_month_day day(year(Digits(text.substr(0, 4))),
                           month(static_cast<unsigned>(Digits(text.substr(5, 2)))),
                           std::chrono::day(static_cast<unsigned>(Digits(text.substr(8, 2)))));
  if (!day.ok()) return std::nullopt;
  const auto midnight = duration_cast<seconds>(sys_days(day).time_since_epoch()).count();
  if (text.size() == kDate) return midnight;
  const int hour = Digits(text.substr(11, 2)), minute = Digits(text.substr(14, 2)),
            second = Digits(text.substr(17, 2));
  if (hour > 23 || minute > 59 || second > 59) return std::nullopt;
  return midnight + hour * 3600 + minute * 60 + second;
}

std::string UtcText(int64_t utc_s) {
  using namespace std::chrono;
  const sys_seconds time{seconds(utc_s)};
  const auto midnight = floor<days>(time);
  const year_month_day day(midnight);
  const hh_mm_ss clock(time - midnight);
  char text[48];
  std::snprintf(text, sizeof text, "%04d-%02u-%02uT%02d:%02d:%02dZ", static_cast<int>(day.year()),
                static_cast<unsigned>(day.month()), static_cast<unsigned>(day.day()),
                static_cast<int>(clock.hours().count()), static_cast<int>(clock.minutes().count()),
                static_cast<int>(clock.seconds().count()));
  return text;
}

}  // namespace taclink
