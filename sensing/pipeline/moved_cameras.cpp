#include "sensing/pipeline/moved_cameras.h"

#include <cmath>
#include <string>
#include <vector>

#include "sensing/camera/camera_fit.h"
#include "sensing/camera/camera_shift.h"
#include "sensing/camera/projection.h"
#include "sensing/core/units.h"
#include "sensing/pipeline/reason_text.h"

namespace taclink {
namespace {

// A wider skin looks like cameras that moved closer by about twice the widening; the model's inflation has an
// error of 5 % (see CameraDiagnosis).
constexpr double kShiftOfWidening = 2 * 0.05;

double MeanWideningMm(const RestShape& rest) {
  const LinkModel& model = rest.model();
  double sum_mm = 0;
  for (int m = 0; m < model.markers.count(); ++m)
    sum_mm += rest.Marker(m).head<2>().norm() - model.RestMarker(m).head<2>().norm();
  return sum_mm / model.markers.count();
}

std::vector<PointImage> ImagesOf(const RestShape& rest, const CameraModel& camera,
                                 std::span<const MarkerObservation> labels,
                                 const Eigen::MatrixXd& errors_mm) {
  const Vec3 center_mm = Projector(camera).center_in_link();
  std::vector<PointImage> images;
  for (size_t m = 0; m < labels.size(); ++m) {
    if (!labels[m].seen) continue;
    PointImage& image = images.emplace_back();
    image.at_mm = SeenPoint(rest, static_cast<int>(m), center_mm, true);
    image.pixel = labels[m].center_px;
    for (Eigen::Index k = 0; k < errors_mm.cols(); ++k)
      image.errors_mm.emplace_back(errors_mm.block<3, 1>(3 * static_cast<Eigen::Index>(m), k));
  }
  return images;
}

}  // namespace

std::optional<Reason> FindMovedCameras(const RestShape& rest, const StereoRig& rig,
                                       const LabelledMarkers& labels, const Eigen::MatrixXd& errors_mm) {
  const double doubt_mm = kShiftOfWidening * std::abs(MeanWideningMm(rest));
  std::string text;
  double worst_mm = 0;
  std::array<std::vector<PointImage>, kCameraCount> images;
  for (const CameraId id : kBothCameras)
    images[Index(id)] = ImagesOf(rest, rig[id], labels.cameras[Index(id)], errors_mm);
  const auto shifts = FindCameraShifts(rig, images);
  if (!shifts) return std::nullopt;
  for (const CameraId id : kBothCameras) {
    const CameraShift& shift = (*shifts)[Index(id)];
    CameraShift certain = shift;
    certain.moved_mm -= doubt_mm;
    if (!IsLarge(certain, rest.model())) continue;
    worst_mm = std::max(worst_mm, shift.moved_mm);
    text += ReasonText("%sthe %s camera has moved by %.2f mm and turned by %.2f degrees",
                       text.empty() ? "" : "; ", Name(id), shift.moved_mm, DegFromRad(shift.turned_rad));
  }
  if (text.empty()) return std::nullopt;
  text += " since it was calibrated: it was mounted again, or knocked; forces may be wrong; calibrate again";
  return Reason{ReasonId::kCamerasMoved, text, worst_mm, LargeShiftMm(rest.model()) + doubt_mm};
}

}  // namespace taclink
