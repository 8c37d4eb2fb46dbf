#include "sensing/pipeline/rest_fit.h"

#include <algorithm>
#include <cmath>
#include <string>
#include <utility>

#include "sensing/camera/rest_check.h"
#include "sensing/core/similar_skin.h"
#include "sensing/pipeline/displaced_labels.h"
#include "sensing/pipeline/image_displacement.h"
#include "sensing/pipeline/moved_cameras.h"
#include "sensing/pipeline/rest_orientation.h"

namespace taclink {
namespace {

constexpr double kLeastSeenFraction = 0.5;  // in each image
constexpr double kStillPx = 1.5;            // a spot is the same one within
constexpr int kMostSteps = 5;
// Of the depth of a dent that is called touched: a fit of the attitude takes up most of what a touch does.
constexpr double kFittedDentShare = 0.3;
constexpr double kExplainedShare = 0.1;  // of the residuals without the fit, that may be left with it
constexpr double kSettledMm = 0.03;      // the last step of the specific force moves no marker more, in units

// The mean places of the spots that most pairs show.
DetectionPair Steady(const std::vector<DetectionPair>& pairs) {
  struct Spot {
    Detection first;
    Vec2 sum_px;
    int count;
    Vec2 mean_px() const { return sum_px / count; }
  };
  DetectionPair steady;
  for (size_t c = 0; c < kCameraCount; ++c) {
    std::vector<Spot> spots;
    for (const DetectionPair& pair : pairs) {
      for (const Detection& seen : pair[c]) {
        const auto known = std::find_if(spots.begin(), spots.end(), [&](const Spot& spot) {
          return (spot.mean_px() - seen.center_px).squaredNorm() < kStillPx * kStillPx;
        });
        if (known == spots.end()) {
          spots.push_back({seen, seen.center_px, 1});
        } else {
          known->sum_px += seen.center_px;
          ++known->count;
        }
      }
    }
    for (const Spot& spot : spots) {
      if (2 * spot.count <= static_cast<int>(pairs.size())) continue;
      steady[c].push_back(spot.first);
      steady[c].back().center_px = spot.mean_px();
    }
  }
  return steady;
}

// Labels that are missing, of spots that are no other marker's.
void FillIn(const std::vector<MarkerObservation>& others, std::vector<MarkerObservation>& labels) {
  for (size_t m = 0; m < std::min(labels.size(), others.size()); ++m) {
    if (labels[m].seen || !others[m].seen) continue;
    if (std::ranges::none_of(labels, [&](const MarkerObservation& label) {
          return label.seen && label.center_px == others[m].center_px;
        }))
      labels[m] = others[m];
  }
}

// The fit of images that may show something else than an untouched skin.
CalibrationOptions WithoutLimits(CalibrationOptions options) {
  options.max_departure = options.max_rms_px = options.max_dent_mm = 1e9;
  options.max_outliers = 1;
  options.progress = nullptr;
  return options;
}

double NoiseOf(const MarkerMean& mean, double rms_px) {
  return mean.variances_px2().empty() ? rms_px : mean.noise_px();
}

}  // namespace

Error SkinMoved() {
  return {ErrorCode::kFailedPrecondition, "the skin moved while its rest shape was taken; do not touch it"};
}

Result<void> CheckMarkerCount(const LinkModel& model, const std::array<int, kCameraCount>& seen) {
  for (const CameraId id : kBothCameras) {
    if (seen[Index(id)] < kLeastSeenFraction * model.markers.count()) {
      return Error{
          ErrorCode::kInvalidArgument,
          std::string(Name(id)) + " camera: only " + std::to_string(seen[Index(id)]) + " of " +
              std::to_string(model.markers.count()) +
              " markers recognised; check model, light and focus, and that nothing touches the skin"};
    }
  }
  return {};
}

RestFit::RestFit(const LinkModel& model, const std::optional<StereoRig>& rig,
                 const CalibrationOptions& options, const RestPairs& pairs, RestSkin skin)
    : model_(model),
      rig_(rig),
      options_(options),
      pairs_(pairs),
      skin_(std::move(skin)),
      steady_(Steady(pairs.detections)) {}

Result<RestResult> RestFit::Explain(const MeasuredLoads& loads) const {
  auto result = rig_ ? ExplainByRig(*rig_, loads) : Calibrate(loads);
  if (const auto touch = FindTouch(result, loads))
    return Error{ErrorCode::kFailedPrecondition, Describe(model_, *touch)};
  if (const std::string trouble = CameraTrouble(result, loads); !trouble.empty())
    return Error{ErrorCode::kInvalidArgument, trouble};
  if (!result) return result;
  if (const auto shape = ShapeAt(result->loads); !shape) return shape.error();
  return result;
}

Result<RestResult> RestFit::Calibrate(const MeasuredLoads& loads) const {
  const auto shape = ShapeAt(loads);
  if (!shape) return shape.error();
  if (!IsRestUncertain(*shape)) return CalibrateAt(*shape, loads, options_);
  return Refine(loads);
}

// Where the skin is touched; none: nothing presses, or no touch explains the images.
std::optional<RestTouch> RestFit::FindTouch(const Result<RestResult>& result,
                                            const MeasuredLoads& loads) const {
  const MeasuredLoads& under = result ? result->loads : loads;
  const auto shape = skin_.shape_at(under);
  const auto responses = skin_.touch_responses_at(under);
  if (!shape || !responses) return std::nullopt;
  const double mould_mm = options_.tolerance.marker_mm;
  if (result && rig_) return FindRestTouch(*shape, *responses, *rig_, result->markers, mould_mm);
  const auto rough = CalibrateRoughly(*shape);
  if (!rough) return std::nullopt;
  return FindRestTouch(*shape, *responses, rough->rig, rough->labels, mould_mm);
}

// By labels that a touch does not disturb: those that SettleCamera corrects by projections are wrong where
// the skin is pressed in.
Result<RestFit::RoughCameras> RestFit::CalibrateRoughly(const RestShape& shape) const {
  DetectionPair detections = steady_;
  RoughCameras rough;
  for (const CameraId id : kBothCameras) {
    auto labels = LabelDisplacedRest(shape, id, detections[Index(id)], pairs_.first[Index(id)]);
    if (!labels) return labels.error();
    rough.labels.cameras[Index(id)] = *std::move(labels);
  }
  CalibrationOptions lenient = WithoutLimits(options_);
  lenient.min_seen = kLeastSeenFraction / 2;
  const auto calibrated = CalibrateFromRest(shape, rough.labels, lenient);
  if (!calibrated) return calibrated.error();
  rough.rig = calibrated->rig;
  return rough;
}

// What is wrong with the cameras, or with which of their images is which.
std::string RestFit::CameraTrouble(const Result<RestResult>& result, const MeasuredLoads& loads) const {
  // Cameras so near to the nominal ones leave no room for a better alternative.
  if (result && result->calibration.departure_cost < kLeastDeparture) return {};
  const auto shape = ShapeAt(result ? result->loads : loads);
  if (!shape || (!result && IsRestUncertain(*shape))) return {};
  if (!rig_) return OrientationTrouble(*shape, steady_, pairs_.first, options_.domes);
  if (result) return {};
  std::vector<Vec3> skin_mm;
  for (int m = 0; m < model_.markers.count(); ++m) skin_mm.push_back(shape->Marker(m));
  const auto diagnosis = DiagnoseImages(model_, *rig_, skin_mm, steady_);
  return diagnosis ? diagnosis->text : std::string();
}

Result<RestShape> RestFit::ShapeAt(const MeasuredLoads& loads) const {
  auto shape = skin_.shape_at(loads);
  if (!shape)
    return Error{
        ErrorCode::kFailedPrecondition,
        "no skin of this model is stable under the known loads; check pressure, gravity and material"};
  return *std::move(shape);
}

// Displacements by one standard deviation of the specific force's errors and of the pressure, stacked, in
// columns.
Eigen::MatrixXd RestFit::LoadErrorsMm(const RestShape& shape, const MeasuredLoads& loads) const {
  Eigen::MatrixXd errors_mm = shape.errors_mm();
  MeasuredLoads more = loads;
  more.pressure_mpa += loads.pressure_sigma_mpa;
  const auto wider = skin_.shape_at(more);
  if (!wider) return errors_mm;
  const Eigen::Index columns = errors_mm.cols();
  errors_mm.conservativeResize(3 * model_.markers.count(), columns + 1);
  for (int m = 0; m < model_.markers.count(); ++m)
    errors_mm.block<3, 1>(3 * m, columns) = wider->Displacement(m) - shape.Displacement(m);
  return errors_mm;
}

// The cameras, from what stands still in the pairs.
Result<RestFit::FoundCameras> RestFit::FindCameras(const RestShape& shape) const {
  DetectionPair detections = steady_;
  FoundCameras found;
  for (const CameraId id : kBothCameras) {
    const auto labels = LabelDisplacedRest(shape, id, detections[Index(id)], pairs_.first[Index(id)]);
    if (!labels) return labels.error();
    auto settled = SettleCamera(shape, id, *labels, detections[Index(id)], options_.domes);
    if (!settled) {
      return Error{ErrorCode::kInvalidArgument, std::string("no camera explains the ") + Name(id) +
                                                    " camera's rest picture; check the link model and that "
                                                    "nothing touches the skin"};
    }
    found.rig[id] = settled->camera;
    found.score += settled->score;
    found.matches[Index(id)] = std::move(settled->match);
  }
  if (const std::string trouble = GridTrouble(model_, found.matches); !trouble.empty())
    return Error{ErrorCode::kInvalidArgument,
                 trouble + ": it is not this link's model, or something touches the skin"};
  return found;
}

// `is_fitted`: the cameras were fitted to these pairs, so that each spot is labeled by the nearest projected
// marker. Cameras of a saved calibration may have moved, and the skin may be touched: spots are then labeled
// by their order along the paths, and only those left, as beside a missing marker, by the nearest projection.
Result<MarkerMean> RestFit::Mean(const RestShape& shape, const StereoRig& rig, bool is_fitted) const {
  PathTracker tracker(model_, rig);
  MarkerMean mean(model_.markers.count());
  LabelledMarkers labels;
  for (const DetectionPair& pair : pairs_.detections) {
    if (!is_fitted) tracker.Label(pair, labels);
    std::array<int, kCameraCount> seen{};
    for (const CameraId id : kBothCameras) {
      std::vector<MarkerObservation>& of_camera = labels.cameras[Index(id)];
      RestMatch match = MatchRestPicture(shape, rig[id], pair[Index(id)], options_.domes, is_fitted);
      if (is_fitted)
        of_camera = std::move(match.markers);
      else
        FillIn(match.markers, of_camera);
      seen[Index(id)] =
          static_cast<int>(std::ranges::count_if(of_camera, [](const auto& marker) { return marker.seen; }));
    }
    if (const auto enough = CheckMarkerCount(model_, seen); !enough) return enough.error();
    mean.Add(labels);
  }
  mean.Finish();
  if (mean.moved()) return SkinMoved();
  return mean;
}

Result<RestResult> RestFit::ExplainByRig(const StereoRig& rig, const MeasuredLoads& loads) const {
  auto shape = ShapeAt(loads);
  if (!shape) return shape.error();
  const auto mean = Mean(*shape, rig, false);
  if (!mean) return mean.error();
  const double most_dent_mm = options_.max_dent_mm * LengthUnit(model_);
  const auto touched = [&](const Dent& dent) {
    return Error{ErrorCode::kFailedPrecondition,
                 Describe(model_, dent) + "; if nothing is there, a camera has moved: calibrate again"};
  };
  RestResult result{.calibration = {}, .markers = mean->markers(), .loads = loads};
  CalibrationSummary seen = ResidualsOf(*shape, rig, mean->markers());
  const auto dent = FindDent(*shape, seen, most_dent_mm);
  if (IsRestUncertain(*shape)) {
    if (const auto fitted = FitRestLoads(loads, skin_.shape_at, rig, mean->markers())) result.loads = *fitted;
    shape = ShapeAt(result.loads);
    if (!shape) return shape.error();
    const double before_px = seen.rms_px;
    seen = ResidualsOf(*shape, rig, mean->markers());
    // Weight explains all of a sag, but only the larger part of what a touch does.
    if (dent && seen.rms_px > kExplainedShare * before_px) return touched(*dent);
    if (const auto left = FindDent(*shape, seen, most_dent_mm)) return touched(*left);
  } else if (dent) {
    return touched(*dent);
  }
  result.calibration.rig = rig;
  result.noise_px = NoiseOf(*mean, seen.rms_px);
  result.moved_cameras = FindMovedCameras(*shape, rig, mean->markers(), LoadErrorsMm(*shape, result.loads));
  return result;
}

Result<RestResult> RestFit::CalibrateAt(const RestShape& shape, const MeasuredLoads& loads,
                                        const CalibrationOptions& options) const {
  const auto found = FindCameras(shape);
  if (!found) return found.error();
  const auto mean = Mean(shape, found->rig, true);
  if (!mean) return mean.error();
  auto calibrated = CalibrateFromRest(shape, mean->markers(), options);
  if (!calibrated) return calibrated.error();
  calibrated->pairs = static_cast<int>(pairs_.detections.size());
  RestResult result{.calibration = *std::move(calibrated), .markers = mean->markers(), .loads = loads};
  result.noise_px = NoiseOf(*mean, result.calibration.rms_px);
  const CalibrationSummary& summary = result.calibration;
  if (summary.error_shares.size() != 3 || summary.error_covariance.size() != 9) return result;
  const Mat3 errors = SpecificForceErrors(loads);
  result.loads.specific_force_mps2 += errors * summary.error_shares;
  result.loads.specific_force_covariance = errors * summary.error_covariance * errors.transpose();
  if (IsAttitudeUnknown(loads)) MeasureGravity(result.loads);
  return result;
}

// The specific force that the bundle adjustment finds near `loads`, from step to step until it stays, and
// what the images show there.
Result<RestResult> RestFit::Refine(MeasuredLoads loads) const {
  const CalibrationOptions lenient = WithoutLimits(options_);
  for (int step = 0; step < kMostSteps; ++step) {
    const auto shape = ShapeAt(loads);
    if (!shape) return shape.error();
    const auto rough = CalibrateAt(*shape, loads, lenient);
    if (!rough) return rough.error();
    const Eigen::VectorXd& shares = rough->calibration.error_shares;
    if (shares.size() != 3) break;
    loads.specific_force_mps2 += SpecificForceErrors(loads) * shares;
    if ((shape->errors_mm() * shares).cwiseAbs().maxCoeff() < kSettledMm * LengthUnit(model_)) break;
  }
  const auto shape = ShapeAt(loads);
  if (!shape) return shape.error();
  CalibrationOptions strict = options_;
  strict.max_dent_mm *= kFittedDentShare;
  return CalibrateAt(*shape, loads, strict);
}

}  // namespace taclink
