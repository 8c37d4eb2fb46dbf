#pragma once

#include <array>
#include <string>
#include <vector>

#include "bench/vision/vision_method.h"
#include "sensing/camera/projection.h"
#include "sensing/core/link_model.h"
#include "sensing/core/link_state.h"
#include "sensing/simulation/renderer.h"
#include "sensing/simulation/skin_truth.h"

namespace taclink {

/// What a camera really sees of a marker.
struct TrueSight {
  bool drawn = false;             ///< some of it may be in the picture and no skin hides it
  bool whole = false;             ///< all of it is inside the picture: whoever does not label it misses it
  Vec2 center_px = Vec2::Zero();  ///< of its outline
  double radius_px = 0;           ///< the longer half axis
};

/// One frame's truth. By marker index.
struct VisionTruth {
  uint64_t frame = 0;
  std::vector<Vec3> positions_mm;
  std::vector<Vec3> displacements_mm;  ///< from the undeformed skin
  std::array<std::vector<TrueSight>, kCameraCount> sights;

  int WholeIn(size_t marker) const {  ///< how many cameras
    return int{sights[0][marker].whole} + int{sights[1][marker].whole};
  }
};

/// `rig`: where the cameras really are.
void MakeVisionTruth(const LinkModel& model, const StereoRig& rig, const Renderer& renderer,
                     const SkinTruth& skin, VisionTruth& truth);

/// Components of an error: along the radius, around the axis (phi R), along Z, and the length of it all.
enum class ErrorAxis : int { kR, kPhiR, kZ, k3d };
inline constexpr size_t kErrorAxes = 4;

struct ErrorSums {
  int64_t count = 0;
  std::array<double, kErrorAxes> squares{};  ///< sums, mm^2
  std::array<double, kErrorAxes> worst{};    ///< absolute, mm

  void Add(const Vec3& error_mm, const Vec3& at_mm);
  void Add(const ErrorSums& other);
  double Rms(ErrorAxis axis) const;
  double Worst(ErrorAxis axis) const { return worst[static_cast<size_t>(axis)]; }
};

/// Labels of one camera against what it sees.
struct LabelCounts {
  int64_t visible = 0;   ///< markers that it sees whole
  int64_t labelled = 0;  ///< by the method
  int64_t wrong = 0;     ///< labels on another marker
  int64_t stray = 0;     ///< labels on no marker at all
  int64_t missing = 0;   ///< visible ones without a label

  void Add(const LabelCounts& other);
};

/// CPU times, ms, one entry a measured frame.
struct StageSamples {
  std::vector<float> decode, detect, label, shape, vision, whole;  ///< vision: detect + label + shape

  void Add(const StageTimes& times);
  void Add(const StageSamples& other);
};

inline constexpr size_t kStatusCount = 5;  ///< of LinkStatus
inline constexpr size_t kSourceCount = 4;  ///< of MarkerSource

/// How well a method did on some frames. By how many cameras see a marker whole where it says [3]:
/// none, one, both; so that a method that drops a marker is not let off.
struct VisionScore {
  int64_t frames = 0;  ///< after the rest frames
  int64_t measured = 0;
  std::array<int64_t, kStatusCount> statuses{};
  std::array<ErrorSums, 3> position, displacement;
  std::array<LabelCounts, kCameraCount> labels;
  /// Normalised error squared of the displacement per degree of freedom, by MarkerSource.
  std::array<std::vector<float>, kSourceCount> nees;
  /// The error of the position split for each scene and marker into its mean over the frames and the rest:
  /// sums of squares, mm^2, over `split_count` markers that both cameras see.
  double systematic = 0, random = 0;
  int64_t split_count = 0;
  StageSamples times;

  void Add(const VisionScore& other);
};

/// Where the worst error of a scene was, and what was wrong with labels, for people.
struct Incidents {
  double worst_mm = 0;  ///< 3-D position, markers that both cameras see
  uint64_t worst_frame = 0;
  int worst_marker = -1;
  std::vector<std::string> labels;  ///< the first few
};

/// Scores one method on one scene, frame by frame.
class VisionScorer {
 public:
  explicit VisionScorer(const LinkModel& model);

  void Add(const VisionTruth& truth, const VisionResult& result);
  /// Adds what needs all frames. Call once, after the last.
  void Finish();

  const VisionScore& score() const { return score_; }
  const Incidents& incidents() const { return incidents_; }

 private:
  struct MarkerSum {
    int count = 0;
    Vec3 sum = Vec3::Zero();
    double squares = 0;
  };
  void AddLabels(const VisionTruth& truth, const VisionResult& result, CameraId id);
  void AddShape(const VisionTruth& truth, const SkinShape& shape);
  void Note(const VisionTruth& truth, CameraId id, size_t marker, int really);
  std::string MarkerName(size_t marker) const;

  const LinkModel model_;
  VisionScore score_;
  Incidents incidents_;
  std::vector<MarkerSum> sums_;
};

/// Value below which `share` of the samples lie; 0 of none. Sorts a copy.
double Percentile(std::vector<float> samples, double share);

/// Of normalised errors squared: mean, mean without the largest 1 %, median. For the right covariance of
/// three degrees of freedom they are 1, 0.965 and 0.789.
struct Consistency {
  int64_t count = 0;
  double mean = 0, trimmed = 0, median = 0;
};
Consistency ConsistencyOf(std::vector<float> nees);

}  // namespace taclink
