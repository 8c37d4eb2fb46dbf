#include "sensing/markers/label/marker_search.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <vector>

namespace taclink {
namespace {

constexpr double kStep = 0.5;     // px, of the profile
constexpr double kSigmaPx = 0.3;  // of a centre found so; grows with the size

// Mean over the marker's width, by the place along the path; NaN: outside the picture.
std::vector<double> Profile(const cv::Mat& gray, const MarkerPlace& place) {
  const Vec2 across(-place.along.y(), place.along.x());
  const auto half = static_cast<int>(std::ceil(place.reach_px / kStep));
  const int width = std::max(0, static_cast<int>(0.6 * place.half_width_px));
  std::vector<double> profile;
  for (int i = -half; i <= half; ++i) {
    double sum = 0;
    int count = 0;
    for (int w = -width; w <= width; ++w) {
      const Vec2 p = place.center_px + i * kStep * place.along + w * across;
      const auto x = static_cast<int>(std::floor(p.x())), y = static_cast<int>(std::floor(p.y()));
      if (x < 0 || y < 0 || x + 1 >= gray.cols || y + 1 >= gray.rows) continue;
      const double ax = p.x() - x, ay = p.y() - y;
      const uint8_t* row = gray.ptr(y);
      const uint8_t* next = gray.ptr(y + 1);
      sum += (1 - ay) * ((1 - ax) * row[x] + ax * row[x + 1]) + ay * ((1 - ax) * next[x] + ax * next[x + 1]);
      ++count;
    }
    profile.push_back(count > 0 ? sum / count : std::nan(""));
  }
  return profile;
}

struct Hump {
  int peak = 0;
  std::array<int, 2> valleys{};   // places in the profile
  std::array<bool, 2> at_edge{};  // the picture ends before there is one
  double Background(const std::vector<double>& profile, double at) const {
    const double a = profile[static_cast<size_t>(valleys[0])], b = profile[static_cast<size_t>(valleys[1])];
    if (at_edge[0]) return b;
    if (at_edge[1]) return a;
    const double t = std::clamp((at - valleys[0]) / std::max(1, valleys[1] - valleys[0]), 0.0, 1.0);
    return a + t * (b - a);
  }
};

// The highest place over the ramp between the darkest places on both sides of it.
std::optional<Hump> FindHump(const std::vector<double>& profile) {
  const auto size = static_cast<int>(profile.size());
  const auto value = [&](int i) { return profile[static_cast<size_t>(i)]; };
  int middle = size / 2, first = middle, last = middle;
  if (std::isnan(value(middle))) {  // just outside the picture: from the nearest place inside
    for (int d = 1; d <= size / 2 && std::isnan(value(middle)); ++d) {
      if (!std::isnan(value(size / 2 - d)))
        middle = size / 2 - d;
      else if (!std::isnan(value(size / 2 + d)))
        middle = size / 2 + d;
    }
    if (std::isnan(value(middle))) return std::nullopt;
    first = last = middle;
  }
  while (first > 0 && !std::isnan(value(first - 1))) --first;
  while (last + 1 < size && !std::isnan(value(last + 1))) ++last;
  std::optional<Hump> best;
  double best_height = 0;
  for (int peak = first; peak <= last; ++peak) {
    Hump hump{.peak = peak, .valleys = {peak, peak}, .at_edge = {first > 0, last + 1 < size}};
    for (int i = first; i < peak; ++i) {
      if (value(i) < value(hump.valleys[0])) hump.valleys[0] = i;
    }
    for (int i = peak + 1; i <= last; ++i) {
      if (value(i) < value(hump.valleys[1])) hump.valleys[1] = i;
    }
    const bool open[2] = {hump.valleys[0] == peak && !hump.at_edge[0],
                          hump.valleys[1] == peak && !hump.at_edge[1]};
    if (open[0] || open[1] || (hump.at_edge[0] && hump.at_edge[1])) continue;
    const double height = value(peak) - hump.Background(profile, peak);
    if (height > best_height) best_height = height, best = hump;
  }
  return best;
}

}  // namespace

std::optional<MarkerFound> FindMarkerAt(const cv::Mat& gray, const MarkerPlace& place, double min_contrast) {
  const std::vector<double> profile = Profile(gray, place);
  const auto hump = FindHump(profile);
  if (!hump) return std::nullopt;
  const double contrast = profile[static_cast<size_t>(hump->peak)] - hump->Background(profile, hump->peak);
  if (contrast < min_contrast) return std::nullopt;

  // Centre by what is above half the contrast, softly, between the valleys and not far off the path.
  const Vec2 across(-place.along.y(), place.along.x());
  const auto half = static_cast<int>(profile.size() / 2);
  const double reach = place.reach_px + place.half_width_px + 1;
  const cv::Rect box =
      cv::Rect(static_cast<int>(place.center_px.x() - reach), static_cast<int>(place.center_px.y() - reach),
               static_cast<int>(2 * reach) + 2, static_cast<int>(2 * reach) + 2) &
      cv::Rect(0, 0, gray.cols, gray.rows);
  double weight = 0;
  Vec2 sum = Vec2::Zero(), low(1e9, 1e9), high(-1e9, -1e9);
  for (int y = box.y; y < box.y + box.height; ++y) {
    for (int x = box.x; x < box.x + box.width; ++x) {
      const Vec2 p(x, y), off = p - place.center_px;
      const double at = off.dot(place.along) / kStep + half;
      const bool before = !hump->at_edge[0] && at < hump->valleys[0];
      const bool after = !hump->at_edge[1] && at > hump->valleys[1];
      if (before || after || std::abs(off.dot(across)) > 1.4 * place.half_width_px + 0.5) continue;
      if (std::abs(off.dot(place.along)) > place.reach_px + 1) continue;
      const double over = (gray.at<uint8_t>(y, x) - hump->Background(profile, at)) / contrast;
      const double w = std::clamp(2 * over - 0.5, 0.0, 1.0);
      if (w <= 0) continue;
      weight += w;
      sum += w * p;
      low = low.cwiseMin(p);
      high = high.cwiseMax(p);
    }
  }
  if (weight < 1) return std::nullopt;
  MarkerFound found{.detection = {}, .contrast = contrast};
  Detection& d = found.detection;
  d.center_px = sum / weight;
  d.width_px = high.x() - low.x() + 1;
  d.height_px = high.y() - low.y() + 1;
  d.area_px2 = weight;
  d.clipped = low.x() < 1 || low.y() < 1 || high.x() >= gray.cols - 1 || high.y() >= gray.rows - 1;
  const double sigma = d.clipped ? 0.25 * std::sqrt(weight) : kSigmaPx + 0.02 * std::sqrt(weight);
  d.covariance_px2 = sigma * sigma * Mat2::Identity();
  return found;
}

}  // namespace taclink
