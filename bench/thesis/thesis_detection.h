#pragma once

#include <opencv2/core.hpp>
#include <vector>

#include "bench/thesis/thesis_camera.h"
#include "sensing/core/geometry.h"
#include "sensing/core/link_model.h"

namespace taclink {

/// Section 4.3 of the thesis, for one camera: the square around the markers is cut out, undesired bright
/// areas are blacked out, the contrast is stretched to the darkest and brightest 1 %, a global threshold,
/// centroids of the bright regions that lie inside the picture.
class ThesisDetection {
 public:
  /// `camera`: the nominal one.
  ThesisDetection(const LinkModel& model, const ThesisCamera& camera);

  /// Chooses what is blacked out and the threshold, in the stretched contrast, from a rest picture: such that
  /// as many regions come out as there should be markers.
  void Tune(const cv::Mat& gray);
  void Detect(const cv::Mat& gray, std::vector<Vec2>& centers);

 private:
  struct Region {
    Vec2 center;
    double least_px, most_px;  // distances of its pixels' box from the principal point
  };
  void Stretch(const cv::Mat& gray);
  void FindRegions(double threshold);
  bool IsMarkerPlace(const Region& region) const;

  Vec2 principal_px_;
  double inner_px_ = 0, outer_px_ = 0;  // where markers can be at rest
  int expected_ = 0;                    // markers in the picture
  double threshold_ = 0.5;              // 0: the darkest 1 %, 1: the brightest
  cv::Rect crop_;
  cv::Mat mask_;  // of the crop; 255: to be looked at
  // Scratch.
  double dark_ = 0, bright_ = 255;
  cv::Mat masked_, binary_, labels_, stats_, centroids_;
  std::vector<Region> regions_;
};

}  // namespace taclink
