#include "sensing/markers/label/rest_labels.h"

#include "sensing/markers/label/picture_labels.h"

namespace taclink {

Result<std::vector<MarkerObservation>> LabelRestPicture(const LinkModel& model, CameraId id,
                                                        Detections& detections, const cv::Mat& gray) {
  const auto labels = LabelPicture(model, id, detections, gray);
  if (!labels) return labels.error();
  std::vector<MarkerObservation> seen(static_cast<size_t>(model.markers.count()));
  for (const PictureMarker& m : labels->markers) {
    seen[static_cast<size_t>(m.marker)] = {true, m.detection.center_px, m.detection.covariance_px2};
    if (m.looked_again) detections.push_back(m.detection);
  }
  return seen;
}

}  // namespace taclink
