#include "bench/thesis/thesis_detection.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <opencv2/imgproc.hpp>

namespace taclink {
namespace {

constexpr int kLeastArea = 3;  // px; less is noise
constexpr size_t kThresholds = 40;
constexpr int kAboutAsGood = 2;  // regions
constexpr double kMaskMarginPx = 1.5;
constexpr double kRoomPx = 15;  // that the picture leaves around the markers at rest, for an inflated skin

double AtStep(size_t step) {
  return static_cast<double>(step + 1) / (kThresholds + 1);
}

}  // namespace

ThesisDetection::ThesisDetection(const LinkModel& model, const ThesisCamera& camera)
    : principal_px_(camera.principal_px) {
  const CameraModel& nominal = model.nominal_rig[camera.id];
  const double dome = model.markers.diameter_mm / 2;
  inner_px_ = std::numeric_limits<double>::infinity();
  for (const Vec3& p : model.RestMarkers()) {
    const auto pixel = camera.Project(p);
    if (!pixel) continue;
    const double size = camera.focal_px * dome / camera.Depth(p.z());
    const double distance = (*pixel - principal_px_).norm();
    inner_px_ = std::min(inner_px_, distance - size);
    outer_px_ = std::max(outer_px_, distance + size);
    const bool inside = pixel->x() > size && pixel->y() > size && pixel->x() < nominal.width_px - 1 - size &&
                        pixel->y() < nominal.height_px - 1 - size;
    expected_ += inside ? 1 : 0;
  }
  const int reach = static_cast<int>(std::ceil(outer_px_ + kRoomPx));
  const int x = static_cast<int>(principal_px_.x()), y = static_cast<int>(principal_px_.y());
  crop_ = cv::Rect(x - reach, y - reach, 2 * reach + 1, 2 * reach + 1) &
          cv::Rect(0, 0, nominal.width_px, nominal.height_px);
  mask_ = cv::Mat(crop_.size(), CV_8U, cv::Scalar(255));
}

void ThesisDetection::Stretch(const cv::Mat& gray) {
  cv::bitwise_and(gray(crop_), mask_, masked_);
  std::array<int, 256> histogram{};
  int all = 0;
  for (int y = 0; y < masked_.rows; ++y) {
    const uint8_t* level = masked_.ptr<uint8_t>(y);
    const uint8_t* looked_at = mask_.ptr<uint8_t>(y);
    for (int x = 0; x < masked_.cols; ++x) {
      if (looked_at[x] == 0) continue;
      ++histogram[level[x]];
      ++all;
    }
  }
  const auto level_below = [&](double share) {
    int sum = 0;
    for (int level = 0; level < 256; ++level) {
      sum += histogram[static_cast<size_t>(level)];
      if (sum >= share * all) return static_cast<double>(level);
    }
    return 255.0;
  };
  dark_ = level_below(0.01);
  bright_ = level_below(0.99);
}

void ThesisDetection::FindRegions(double threshold) {
  regions_.clear();
  cv::threshold(masked_, binary_, dark_ + threshold * (bright_ - dark_), 255, cv::THRESH_BINARY);
  const int count = cv::connectedComponentsWithStats(binary_, labels_, stats_, centroids_, 8, CV_32S);
  for (int i = 1; i < count; ++i) {
    if (stats_.at<int>(i, cv::CC_STAT_AREA) < kLeastArea) continue;
    const int width = stats_.at<int>(i, cv::CC_STAT_WIDTH), height = stats_.at<int>(i, cv::CC_STAT_HEIGHT);
    const int left = stats_.at<int>(i, cv::CC_STAT_LEFT), top = stats_.at<int>(i, cv::CC_STAT_TOP);
    if (left == 0 || top == 0 || left + width == crop_.width || top + height == crop_.height) continue;
    const Vec2 center(centroids_.at<double>(i, 0) + crop_.x, centroids_.at<double>(i, 1) + crop_.y);
    const double half = std::hypot(width, height) / 2, distance = (center - principal_px_).norm();
    regions_.push_back({center, distance - half, distance + half});
  }
}

bool ThesisDetection::IsMarkerPlace(const Region& region) const {
  const double distance = (region.center - principal_px_).norm();
  return distance > inner_px_ && distance < outer_px_;
}

void ThesisDetection::Tune(const cv::Mat& gray) {
  Stretch(gray);
  std::array<int, kThresholds> off{};  // how many regions too many or too few
  for (size_t step = 0; step < kThresholds; ++step) {
    FindRegions(AtStep(step));
    const auto markers = std::count_if(regions_.begin(), regions_.end(),
                                       [this](const Region& region) { return IsMarkerPlace(region); });
    off[step] = std::abs(static_cast<int>(markers) - expected_);
  }
  // The middle of the widest range of thresholds that do about as well as the best.
  const int good = *std::min_element(off.begin(), off.end()) + kAboutAsGood;
  size_t widest = 0, begin = 0;
  for (size_t step = 0; step < kThresholds; ++step) {
    if (off[step] > good) {
      begin = step + 1;
    } else if (step + 1 - begin > widest) {
      widest = step + 1 - begin;
      threshold_ = (AtStep(begin) + AtStep(step)) / 2;
    }
  }
  FindRegions(threshold_);
  double hole = 0, rim = std::numeric_limits<double>::infinity();
  for (const Region& region : regions_) {
    const double distance = (region.center - principal_px_).norm();
    if (distance <= inner_px_) hole = std::max(hole, std::min(region.most_px + kMaskMarginPx, inner_px_));
    if (distance >= outer_px_) rim = std::min(rim, std::max(region.least_px - kMaskMarginPx, outer_px_));
  }
  for (int y = 0; y < mask_.rows; ++y) {
    for (int x = 0; x < mask_.cols; ++x) {
      const double distance = (Vec2(x + crop_.x, y + crop_.y) - principal_px_).norm();
      mask_.at<uint8_t>(y, x) = distance > hole && distance < rim ? 255 : 0;
    }
  }
}

void ThesisDetection::Detect(const cv::Mat& gray, std::vector<Vec2>& centers) {
  centers.clear();
  if (gray.cols < crop_.x + crop_.width || gray.rows < crop_.y + crop_.height) return;
  Stretch(gray);
  FindRegions(threshold_);
  for (const Region& region : regions_) centers.push_back(region.center);
}

}  // namespace taclink
