#include "client/command/offline/calibrate_picture.h"

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <opencv2/imgproc.hpp>
#include <string>
#include <vector>

namespace taclink::command {
namespace {

constexpr int kZoom = 2, kFooter = 64, kGap = 8;
constexpr double kTypicalArrowPx = 18;  // of the drawing, for a residual of the usual size
const cv::Scalar kUsedColor(80, 220, 0), kOutlierColor(60, 80, 255), kTextColor(230, 230, 230);
const cv::Scalar kBackgroundColor(40, 32, 28);

// Largest of 1, 2 and 5 times a power of ten that is at most x.
double Round125(double x) {
  const double power = std::pow(10, std::floor(std::log10(x)));
  for (const double step : {5.0, 2.0}) {
    if (step * power <= x) return step * power;
  }
  return power;
}

cv::Point2d Drawn(const Vec2& px) {
  return {kZoom * (px.x() + 0.5), kZoom * (px.y() + 0.5)};
}

void Text(cv::Mat& picture, const std::string& text, int x, int y) {
  cv::putText(picture, text, {x, y}, cv::FONT_HERSHEY_SIMPLEX, 0.5, kTextColor, 1, cv::LINE_AA);
}

void DrawArrow(cv::Mat& picture, cv::Point2d from, cv::Point2d to, const cv::Scalar& color) {
  constexpr int kShift = 4;
  const auto fixed = [](cv::Point2d p) {
    return cv::Point(static_cast<int>(p.x * (1 << kShift)), static_cast<int>(p.y * (1 << kShift)));
  };
  cv::circle(picture, fixed(from), 2 << kShift, color, cv::FILLED, cv::LINE_AA, kShift);
  cv::line(picture, fixed(from), fixed(to), color, 1, cv::LINE_AA, kShift);
}

cv::Mat DrawCamera(const cv::Mat& gray, const CameraCalibration& one, double magnification) {
  cv::Mat large, picture;
  cv::resize(gray, large, {}, kZoom, kZoom, cv::INTER_NEAREST);
  large *= 0.6;  // the arrows stand out
  cv::cvtColor(large, picture, cv::COLOR_GRAY2BGR);
  for (const MarkerResidual& r : one.residuals) {
    if (r.kind == MarkerResidual::Kind::kUnseen) continue;
    const cv::Point2d from = Drawn(r.seen_px), to = Drawn(r.seen_px + magnification * r.residual_px);
    DrawArrow(picture, from, to, r.kind == MarkerResidual::Kind::kUsed ? kUsedColor : kOutlierColor);
  }
  return picture;
}

void DrawFooter(cv::Mat& footer, CameraId id, const CameraCalibration& one, double magnification) {
  char text[160];
  std::snprintf(text, sizeof text, "%s: %d markers used, %d left out (red), RMS %.3f px per axis", Name(id),
                one.markers_used, one.outliers, one.rms_px);
  Text(footer, text, 12, 24);
  const double scale_px = Round125(120 / (kZoom * magnification));  // of the camera's picture
  const cv::Point2d from(14, 46), to = from + cv::Point2d(kZoom * magnification * scale_px, 0);
  DrawArrow(footer, from, to, kUsedColor);
  std::snprintf(text, sizeof text, "%g px (residuals %.0f times as long)", scale_px, magnification);
  Text(footer, text, static_cast<int>(to.x) + 12, 51);
}

}  // namespace

cv::Mat ResidualPicture(const RestPictures& rest, const CalibrationSummary& summary) {
  const double magnification =
      std::max(1.0, Round125(kTypicalArrowPx / (kZoom * std::max(1e-3, summary.rms_px))));
  std::vector<cv::Mat> columns;
  int height = 0, width = -kGap;
  for (const CameraId id : kBothCameras) {
    const CameraCalibration& one = summary.cameras[Index(id)];
    const cv::Mat drawn = DrawCamera(rest[Index(id)], one, magnification);
    const cv::Mat column(drawn.rows + kFooter, drawn.cols, CV_8UC3, kBackgroundColor);
    drawn.copyTo(column.rowRange(0, drawn.rows));
    cv::Mat footer = column.rowRange(drawn.rows, column.rows);
    DrawFooter(footer, id, one, magnification);
    height = std::max(height, column.rows);
    width += column.cols + kGap;
    columns.push_back(column);
  }
  cv::Mat picture(height, width, CV_8UC3, kBackgroundColor);
  int x = 0;
  for (const cv::Mat& column : columns) {
    column.copyTo(picture(cv::Rect(x, 0, column.cols, column.rows)));
    x += column.cols + kGap;
  }
  return picture;
}

}  // namespace taclink::command
