#include "sensing/pipeline/picture_calibration.h"

#include <algorithm>
#include <cmath>
#include <string>
#include <vector>

#include "sensing/markers/detect/detector.h"
#include "sensing/markers/label/rest_labels.h"
#include "sensing/pipeline/rest_match.h"

namespace taclink {
namespace {

using PairDetections = std::array<Detections, kCameraCount>;

constexpr double kScatteredPx = 1,
                 kScatteredFraction = 0.03;  // more markers that scatter more: the skin moved
// Swapped pictures that fit are refused if they put the cameras nearer to the nominal ones by this much
// (difference of half the squared distance in tolerances).
constexpr double kSwapMargin = 6;
constexpr double kSwapDoubt = 12;  // stands for a pair that does not fit as given

Error Refusal(const std::string& what) {
  return {ErrorCode::kInvalidArgument, "calibration refused: " + what};
}

Result<void> CheckSize(const LinkModel& model, CameraId id, const cv::Mat& picture) {
  const CameraModel& camera = model.nominal_rig[id];
  if (picture.type() == CV_8UC1 && picture.cols == camera.width_px && picture.rows == camera.height_px)
    return {};
  return Refusal(std::string("the ") + Name(id) + " picture is " + std::to_string(picture.cols) + " x " +
                 std::to_string(picture.rows) + " px, but the model's camera sends " +
                 std::to_string(camera.width_px) + " x " + std::to_string(camera.height_px) +
                 "; take the pictures as the camera sends them, or correct the model's image_size_px");
}

Result<SettledCamera> Settle(const LinkModel& model, CameraId id, Detections detections,
                             const cv::Mat& picture, const CalibrationOptions& options) {
  const auto labels = LabelRestPicture(model, id, detections, picture);
  if (!labels) return Refusal(labels.error().message);
  auto settled = SettleCamera(model, id, *labels, detections, options.domes);
  if (!settled) {
    return Refusal(std::string("no camera explains the ") + Name(id) +
                   " picture: check that the model is this link's, and that nothing touches the skin");
  }
  return *std::move(settled);
}

// The mean of every marker that more than half of the pairs show.
class RestMean {
 public:
  explicit RestMean(const LinkModel& model) {
    for (auto& camera : sums_) camera.resize(static_cast<size_t>(model.markers.count()));
  }

  void Add(CameraId id, const std::vector<MarkerObservation>& markers) {
    for (size_t i = 0; i < markers.size(); ++i) {
      if (!markers[i].seen) continue;
      Sum& sum = sums_[Index(id)][i];
      ++sum.count;
      sum.center += markers[i].center_px;
      sum.squares += markers[i].center_px.squaredNorm();
      sum.covariance += markers[i].covariance_px2;
    }
  }

  LabelledMarkers Mean(int pairs) const {
    LabelledMarkers mean;
    for (size_t c = 0; c < kCameraCount; ++c) {
      for (const Sum& sum : sums_[c]) {
        const double n = std::max(1, sum.count);
        mean.cameras[c].push_back({2 * sum.count > pairs, sum.center / n, sum.covariance / (n * n)});
      }
    }
    return mean;
  }

  /// Whether more markers moved than noise explains.
  bool Moved() const {
    int repeated = 0, moved = 0;
    for (const auto& camera : sums_) {
      for (const Sum& sum : camera) {
        if (sum.count < 2) continue;
        const double n = sum.count;
        ++repeated;
        moved += (sum.squares - sum.center.squaredNorm() / n) / (2 * (n - 1)) > kScatteredPx * kScatteredPx
                     ? 1
                     : 0;
      }
    }
    return moved > kScatteredFraction * repeated;
  }

 private:
  struct Sum {
    int count = 0;
    Vec2 center = Vec2::Zero();
    double squares = 0;
    Mat2 covariance = Mat2::Zero();
  };
  std::array<std::vector<Sum>, kCameraCount> sums_;
};

Result<CalibrationSummary> Calibrate(const LinkModel& model, const std::vector<PairDetections>& pairs,
                                     const RestPictures& first_pair, const CalibrationOptions& options) {
  std::array<RestMatch, kCameraCount> first;
  RestMean mean(model);
  for (const CameraId id : kBothCameras) {
    auto settled = Settle(model, id, pairs.front()[Index(id)], first_pair[Index(id)], options);
    if (!settled) return settled.error();
    mean.Add(id, settled->match.markers);
    for (size_t i = 1; i < pairs.size(); ++i)
      mean.Add(id, MatchRestPicture(model, settled->camera, pairs[i][Index(id)], options.domes).markers);
    first[Index(id)] = std::move(settled->match);
  }
  if (const std::string trouble = GridTrouble(model, first); !trouble.empty())
    return Refusal(trouble + ": it is not this link's model, or something touches the skin");
  if (mean.Moved()) return Refusal("the skin moved between the pairs of pictures; do not touch it");
  auto summary = CalibrateFromRest(model, mean.Mean(static_cast<int>(pairs.size())), options);
  if (summary) summary->pairs = static_cast<int>(pairs.size());
  return summary;
}

// True if the pictures explain the model better the other way round.
bool LookSwapped(const LinkModel& model, std::vector<PairDetections> pairs, RestPictures first_pair,
                 const Result<CalibrationSummary>& as_given, CalibrationOptions options) {
  for (auto& pair : pairs) std::swap(pair[0], pair[1]);
  std::swap(first_pair[0], first_pair[1]);
  options.progress = nullptr;
  const auto swapped = Calibrate(model, pairs, first_pair, options);
  if (!swapped) return false;
  return swapped->departure_cost + kSwapMargin < (as_given ? as_given->departure_cost : kSwapDoubt);
}

}  // namespace

Result<CalibrationSummary> CalibrateFromPictures(const LinkModel& model, std::span<const RestPictures> pairs,
                                                 const CalibrationOptions& options) {
  if (pairs.empty()) return Refusal("no rest pictures given");
  MarkerDetector detector;
  std::vector<PairDetections> detections(pairs.size());
  for (size_t i = 0; i < pairs.size(); ++i) {
    if (options.progress) {
      options.progress(
          {0.3 * static_cast<double>(i) / static_cast<double>(pairs.size()),
           "find the markers of pair " + std::to_string(i + 1) + " of " + std::to_string(pairs.size())});
    }
    for (const CameraId id : kBothCameras) {
      const cv::Mat& picture = pairs[i][Index(id)];
      if (auto good = CheckSize(model, id, picture); !good) return good.error();
      detector.Detect(picture, detections[i][Index(id)]);
    }
  }
  CalibrationOptions rest_of_way = options;
  if (options.progress) {
    rest_of_way.progress = [&options](const CalibrationProgress& one) {
      options.progress({0.3 + 0.6 * one.done, one.step});
    };
  }
  auto result = Calibrate(model, detections, pairs.front(), rest_of_way);
  if (options.progress) options.progress({0.9, "try the pictures the other way round"});
  if (LookSwapped(model, detections, pairs.front(), result, options)) {
    return Refusal(
        "the pictures look swapped: they fit the model with top as bottom and bottom as top; give them the "
        "other "
        "way round");
  }
  if (options.progress) options.progress({1, "done"});
  return result;
}

Result<CameraCalibration> CalibrateFromPicture(const LinkModel& model, CameraId id, const cv::Mat& picture,
                                               const CalibrationOptions& options) {
  if (auto good = CheckSize(model, id, picture); !good) return good.error();
  MarkerDetector detector;
  Detections detections;
  detector.Detect(picture, detections);
  const auto settled = Settle(model, id, detections, picture, options);
  if (!settled) return settled.error();
  return CalibrateCamera(model, id, settled->match.markers, options);
}

}  // namespace taclink
