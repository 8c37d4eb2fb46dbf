#pragma once

#include <opencv2/core/mat.hpp>
#include <vector>

#include "sensing/core/link_model.h"
#include "sensing/core/markers.h"
#include "sensing/core/result.h"
#include "sensing/markers/label/picture_grid.h"

namespace taclink {

struct PictureMarker {
  int marker = 0;  ///< index, see LinkModel
  Detection detection;
  bool looked_again = false;  ///< not among the detections: found at the place where it had to be
};

struct PictureLabels {
  std::vector<PictureMarker> markers;  ///< by rising index, each at most once
  PictureGrid grid;                    ///< lengths in it are those of the SimilarSkin
};

/// Labels the markers of one picture of a camera that was never calibrated, also of a touched skin. A picture
/// of a rotationally symmetric grid does not show how far the camera is rolled: path 1 is the path nearest to
/// where the model's nominal rig sees it. A PictureGrid is fitted to what is undeformed; every path's spots
/// are aligned with its rings (ChainAlignment), guided by how the neighbouring paths are displaced; what has
/// a second choice nearly as good is left out. With `gray` (the picture, CV_8UC1), markers that are missing
/// among the detections are looked for where their neighbours say that they are. Allocates.
/// Errors: kInvalidArgument, with what does not fit; also if a ring or a path of the model is nowhere seen.
Result<PictureLabels> LabelPicture(const LinkModel& model, CameraId id, const Detections& detections,
                                   const cv::Mat& gray = {});

}  // namespace taclink
