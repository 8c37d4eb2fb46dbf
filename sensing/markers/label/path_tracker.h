#pragma once

#include <array>
#include <cstdint>
#include <span>
#include <vector>

#include "sensing/camera/projection.h"
#include "sensing/core/link_model.h"
#include "sensing/core/markers.h"
#include "sensing/core/similar_skin.h"
#include "sensing/markers/label/ring_numbering.h"

namespace taclink {

struct PathTrackerOptions {
  double lambda = 0.5;                ///< weight of smoothness against closeness [duong2021, (4.27)]
  double alpha_rad = RadFromDeg(30);  ///< search angle at the node before [duong2021, (4.29)]
  double beta_rad = RadFromDeg(30);   ///< search angle at the far end [duong2021, (4.29)]
  /// A detection further than this from a path's angle is none of it; in path pitches.
  double sector = 0.6;
  /// A detection whose area is off the expected one by more than this factor is dust or a reflection.
  double max_area_ratio = 6;
  /// Skin is continuous: a marker's displacement beyond what both neighbouring paths show at its ring,
  /// inwards by more than this and times theirs, or outwards by more than this, is a wrong label's. Inwards
  /// is counted from rest and from what a ring that is inflated does as a whole.
  double max_beyond_mm = 2.5, max_beyond_times = 2;
  /// Paths around that are displaced by less tell nothing: at a third of what a label that is a ring off is
  /// displaced by on the shipped skins.
  double least_around_mm = 2;
  RingNumberingOptions numbering;
};

/// Detections to labels for any skin shape by a search from scratch: [duong2021, (4.25) to (4.29)], improved.
///
/// 1. Trace. In each picture all paths grow at once from the clamped end near the camera towards the far one,
///    a node at a time by [duong2021, (4.27)]; a detection that two paths want goes to the cheaper one. This
///    gives each path's detections in their order, which is also the order of the rings: a camera on the axis
///    sees no two points of a path in reverse order.
/// 2. Number. Which ring each of them is takes both pictures, see RingNumbering. Paths of which some
///    detections could not be numbered, as those that leave the pictures at an inflated skin's ends, are
///    numbered once more beside those around them of which all were, if that numbers more.
/// 3. Check. A label whose displacement does not suit those of the neighbouring paths is dropped.
///
/// Lengths in the options and inside are those of the SimilarSkin. Constant after construction but for
/// scratch memory: one thread.
class PathTracker {
 public:
  PathTracker(const LinkModel& model, const StereoRig& rig, PathTrackerOptions options = {})
      : PathTracker(SimilarSkin(model, rig), options) {}

  /// What can't be labelled safely is left unseen. Clipped detections are labelled too, with their large
  /// sigma.
  void Label(const std::array<Detections, kCameraCount>& detections, LabelledMarkers& out);

 private:
  PathTracker(const SimilarSkin& skin, PathTrackerOptions options);
  struct Candidate {
    Vec2 pixel;
    int path = 0;       // the nearest
    double offset = 0;  // angle from it, in pitches
    bool taken = false;
  };
  struct Tracing {  // of a path
    Vec2 node, end;
    int best = -1;  // candidate
    double cost = 0;
    bool active = false;
  };
  struct View {  // constant after construction
    Projector projector;
    std::vector<Vec2> starts, ends;  // by path: pixels of the clamped ends [duong2021, (4.7), (4.8)]
    std::vector<bool> usable;
    struct Area {
      double radius_px, area_px2;
    };
    std::vector<Area> areas;  // of the markers at rest, by rising distance from the principal point
  };

  void FindEnds(CameraId id, View& view) const;
  void FindAreas(View& view) const;
  bool AreaFits(const View& view, const Detection& d) const;
  void SortIntoPaths(CameraId id, const Detections& detections);
  std::span<const SightRay> RaysOf(CameraId id, int path);
  void Number(int path, std::span<const double> around_mm);
  void FindReferences();
  void FindRings();
  bool FindAround(int path);
  void DropImplausible(LabelledMarkers& out);
  void Trace(CameraId id);
  void FindBest(int path, Tracing& tracing) const;

  const LinkModel model_;
  const PathTrackerOptions options_;
  std::vector<View> views_;  // by camera
  std::vector<Candidate> candidates_;
  std::vector<std::vector<int>> by_path_;  // candidates, by nearest path
  std::vector<Tracing> tracings_;
  std::array<std::vector<std::vector<int>>, kCameraCount> chains_;  // detections, by path, near to far
  std::array<std::vector<SightRay>, kCameraCount> rays_;            // by detection
  std::array<std::vector<SightRay>, kCameraCount> path_rays_;       // of one path's chains
  std::vector<int> owners_;                                         // path, by candidate
  std::array<std::vector<int>, kCameraCount> places_;  // in its path's chain, by marker; -1: none
  std::vector<int> numbered_;                          // by path: detections with a label
  std::vector<double> displacements_mm_;               // radial, by marker; NaN: not labelled
  std::vector<double> around_mm_;                      // the same of the paths around one, by ring
  std::vector<uint8_t> complete_;                      // by path: others are numbered beside it
  std::vector<double> whole_ring_mm_;                  // what all of a ring have in common, by ring
  std::vector<double> ring_mm_;                        // of one ring
  std::vector<int> dropped_;
  double mean_radius_mm_ = 0;
  RingNumbering numbering_;
};

}  // namespace taclink
