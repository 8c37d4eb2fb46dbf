#include "sensing/pipeline/rest_orientation.h"

#include <opencv2/core.hpp>
#include <optional>
#include <utility>

#include "sensing/pipeline/displaced_labels.h"
#include "sensing/pipeline/rest_match.h"

namespace taclink {
namespace {

// By so much the alternative must be better, in markers (SettledCamera::score): four for each unit of half
// the squared distance from the nominal cameras, in tolerances.
constexpr double kSwapMargin = 24, kTurnMargin = 4 * kLeastDeparture;
// Residuals of an orientation that fits, over what noise and mould explain: 1 in the simulation.
constexpr double kMostMisfit = 3;
// What as many markers as that count for, where the images as given show no camera at all.
constexpr double kNoCameraShare = 0.5;

struct Flip {
  int flip;  // as cv::flip has it
  const char* text;
};
constexpr std::array<Flip, 3> kFlips = {Flip{1, "mirrored, left and right exchanged"},
                                        Flip{0, "mirrored, upside down"}, Flip{-1, "turned by 180 degrees"}};

std::optional<SettledCamera> Settle(const RestShape& shape, CameraId id, Detections spots,
                                    const cv::Mat& image, bool domes) {
  const auto labels = LabelDisplacedRest(shape, id, spots, image);
  return labels ? SettleCamera(shape, id, *labels, spots, domes) : std::nullopt;
}

// Of an alternative, which must fit by itself: nothing, where it does not.
double Score(const std::optional<SettledCamera>& settled) {
  return settled && settled->misfit < kMostMisfit ? settled->score : 0;
}

double TurnedScore(const RestShape& shape, CameraId id, Detections spots, const cv::Mat& image, int flip,
                   bool domes) {
  cv::Mat turned;
  cv::flip(image, turned, flip);
  for (Detection& spot : spots) {
    if (flip != 0) spot.center_px.x() = image.cols - 1 - spot.center_px.x();
    if (flip <= 0) spot.center_px.y() = image.rows - 1 - spot.center_px.y();
    if (flip >= 0) spot.covariance_px2(0, 1) = spot.covariance_px2(1, 0) = -spot.covariance_px2(0, 1);
  }
  return Score(Settle(shape, id, std::move(spots), turned, domes));
}

}  // namespace

std::string OrientationTrouble(const RestShape& shape, const std::array<Detections, kCameraCount>& spots,
                               const std::array<cv::Mat, kCameraCount>& images, bool domes) {
  std::array<double, kCameraCount> as_given{}, exchanged{};
  for (const CameraId id : kBothCameras) {
    const size_t i = Index(id);
    const auto settled = Settle(shape, id, spots[i], images[i], domes);
    as_given[i] = settled ? settled->score : kNoCameraShare * shape.model().markers.count();
    exchanged[i] = Score(Settle(shape, id, spots[1 - i], images[1 - i], domes));
  }
  if (exchanged[0] + exchanged[1] > as_given[0] + as_given[1] + kSwapMargin)
    return "the pictures look swapped: they fit the model with top as bottom and bottom as top; give them "
           "the other way round";
  for (const CameraId id : kBothCameras) {
    const size_t i = Index(id);
    double best = as_given[i] + kTurnMargin;
    const Flip* found = nullptr;
    for (const Flip& turn : kFlips) {
      const double score = TurnedScore(shape, id, spots[i], images[i], turn.flip, domes);
      if (score <= best) continue;
      best = score;
      found = &turn;
    }
    if (found != nullptr)
      return std::string("the ") + Name(id) + " picture looks " + found->text +
             ": so it fits the model's camera; take the pictures as the camera sends them, or correct the "
             "model's principal point";
  }
  return {};
}

}  // namespace taclink
