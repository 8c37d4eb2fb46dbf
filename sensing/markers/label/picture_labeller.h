#pragma once

#include <opencv2/core/mat.hpp>
#include <optional>
#include <string>
#include <vector>

#include "sensing/core/link_model.h"
#include "sensing/core/markers.h"
#include "sensing/core/result.h"
#include "sensing/markers/label/chain_alignment.h"
#include "sensing/markers/label/marker_search.h"
#include "sensing/markers/label/picture_grid.h"
#include "sensing/markers/label/picture_labels.h"

namespace taclink {

/// LabelPicture's state, for one picture. Spots are aligned with rings (picture_align.cpp), markers that are
/// missing are looked for (picture_look.cpp).
class PictureLabeller {
 public:
  PictureLabeller(const LinkModel& model, CameraId id, const Detections& detections, const cv::Mat& gray,
                  PictureGrid grid)
      : model_(model),
        id_(id),
        camera_(model.nominal_rig[id]),
        detections_(detections),
        given_(detections.size()),
        gray_(gray),
        grid_(std::move(grid)),
        paths_(model.markers.paths),
        rings_(model.markers.rings()) {
    cells_.resize(static_cast<size_t>(paths_ * rings_));
    const double sign = id == CameraId::kTop ? 1 : -1, origin = id == CameraId::kTop ? 0 : model.length_mm;
    for (int j = 0; j < rings_; ++j) {
      along_mm_.push_back(sign * (model.RestMarker(MarkerAt(0, j)).z() - origin));
    }
  }

  Result<PictureLabels> Run();

 private:
  static constexpr double kSector = 0.4;  // path pitches off a line
  static constexpr double kMaxOutwardMm = 15;
  static constexpr double kAtRestMm = 1.2;
  struct Spot {
    int detection = 0;
    double off_path = 0, log_radius = 0, tan = 0;
    int ring = -1;
  };
  struct Cell {  // of the grid; rings from the camera's end
    std::optional<Detection> detection;
    double off_path = 0, log_radius = 0, displacement_mm = 0;  // inwards
    bool looked_again = false;
  };

  int MarkerAt(int path, int ring_from_near) const {
    return model_.MarkerIndex(path, id_ == CameraId::kTop ? ring_from_near : rings_ - 1 - ring_from_near);
  }
  Cell& At(int path, int ring) {
    return cells_[static_cast<size_t>((path + paths_) % paths_ * rings_ + ring)];
  }
  bool Has(int path, int ring) { return ring >= 0 && ring < rings_ && At(path, ring).detection; }
  double DisplacementOf(double tan, int ring) const {
    return grid_.ring_radius_mm(ring) - grid_.ring_distance_mm(ring) * tan;
  }
  bool Possible(double displacement_mm, int ring) const {
    return displacement_mm > -kMaxOutwardMm &&
           grid_.ring_radius_mm(ring) - displacement_mm > model_.tube_outer_radius_mm - 1;
  }
  bool Inside(const Vec2& p, double margin) const {
    return p.x() > margin && p.y() > margin && p.x() < camera_.width_px - margin &&
           p.y() < camera_.height_px - margin;
  }

  // picture_labels.cpp
  void SortIntoPaths();
  double SpacingAt(double log_radius) const;
  int NearestRing(double log_radius) const;
  bool SizeFits(const Detection& d, int ring) const;
  void LearnAreas();
  Error Refusal(const std::string& why) const;
  bool IsResolved(int ring) const;
  Result<void> CheckComplete();
  PictureLabels Labels();

  // picture_align.cpp
  struct Expected {
    double displacement_mm = 0, sigma_mm = 0;
  };
  std::optional<Expected> FromNeighbours(int path, int ring);
  double CostOf(const Spot& spot, int ring, double displacement_mm, const std::optional<Expected>& expected);
  void AlignPath(int path);
  void TakeLabels();
  void DropImplausible();
  double PitchMm(int ring) const;
  void CountFromRim(int path, std::vector<bool>& sure);
  bool NeighboursAgree(int path, int ring, const std::vector<bool>& sure);
  void DropUnsure();

  // picture_look.cpp
  void FillChain(int path);
  std::optional<Cell> Predict(int path, int ring);
  double GapTo(int path, int ring, int step, double log_radius);
  void LookAgain();
  MarkerPlace PlaceFor(int path, int ring, const Cell& cell);
  double NeighbourContrast(int path, int ring);
  std::optional<Cell> LookAt(int path, int ring);
  bool IsTaken(const Detection& d) const;
  Detection BetterOf(const Detection& found) const;

  const LinkModel& model_;
  const CameraId id_;
  const CameraModel& camera_;
  Detections detections_;  // the given ones, then those found along the paths
  const size_t given_;
  const cv::Mat& gray_;
  const PictureGrid grid_;
  const int paths_, rings_;
  std::vector<double> along_mm_;          // rings, from the clamped end near the camera
  std::vector<std::vector<Spot>> spots_;  // by path, from near to far
  std::vector<double> log_areas_;         // by ring
  std::vector<Cell> cells_;
  int labelled_ = 0;
  ChainAlignment alignment_;
};

}  // namespace taclink
