#pragma once

#include <array>
#include <opencv2/core/mat.hpp>
#include <optional>
#include <span>
#include <vector>

#include "sensing/core/link_model.h"
#include "sensing/core/markers.h"
#include "sensing/core/similar_skin.h"
#include "sensing/core/tracking_report.h"
#include "sensing/markers/label/label_check.h"
#include "sensing/markers/track/reference_patch.h"
#include "sensing/markers/track/window_measure.h"

namespace taclink {

struct MarkerTrackerOptions {
  double max_shift_px = 0.6;   ///< that a reference patch is used for, beside whole pixels
  double max_motion_mm = 1.5;  ///< of a marker from frame to frame, beside what its last motion predicts
  /// More of the markers seen in the frame before lost at once: look at the full picture.
  double max_loss = 0.12;
  /// So many lost at once where the skin was displaced by that part of the pitch: it may have let go, and a
  /// spot that is still found where the prediction has the skin may be the next ring's. Likewise.
  int max_loss_displaced = 8;
  double displaced_part = 0.3;
  /// Fewer than this part of all markers seen: look at the full picture after 8 frames, then 16, 32 ...
  double retry_below = 0.7;
  int max_retry_frames = 256;
  /// A marker that both cameras see is off its predicted z by at most this part of what it would be off if
  /// one camera had taken the next ring's marker for it: one just found again, and one that was followed.
  double max_slip_found = 0.35;
  double max_slip_followed = 0.6;
  double max_slip_from_rest = 0.75;  ///< the same, off its z at rest
  /// How far off a marker may be from where it is expected in a picture: this, and that part of what is
  /// displaced there in the picture, where the other camera sees it and where it does not.
  double prediction_px = 0.4, prediction_part_seen = 0.1, prediction_part = 0.3;
  /// On the ray of a camera that sees it: along z, that part of what is displaced there.
  double prediction_z_part = 0.3, max_prediction_z_mm = 3;
  /// One that no camera sees may be pushed in further than predicted, and stands for a displacement.
  double unseen_push_mm = 8, unseen_mm = 4;
  double found_px = 0.6;  ///< more than all that where a label was just found
  LabelCheckOptions check;
};

/// Follows labelled markers from picture to picture in small windows.
///
/// 1. Verify. A marker that looks as before but for a small shift is registered to its reference patch.
/// 2. Measure. One that moved further, or looks different, is looked for where its motion predicts, and its
///    spot is measured again; that is the new reference. So no error adds up.
/// 3. Search. One without a label is looked for where the predicted shape has it, often at first, then less.
/// 4. Check. Labels that contradict the geometry are dropped: those out of order along their path, two on one
///    spot, rays that do not meet on the marker's ring; one that is found again must be where it is
///    predicted. So are labels that the next markers of the path without a label would explain as well, or
///    share: those are taken to be anywhere on the other camera's ray near their ring, or on the way in.
///
/// A centre means what it means for the detector that gave the labels. Lengths in the options and inside are
/// those of the SimilarSkin. Allocates at construction only. One thread.
class MarkerTracker {
 public:
  using Pictures = std::array<cv::Mat, kCameraCount>;  ///< CV_8UC1; empty: none from that camera

  MarkerTracker(const LinkModel& model, const StereoRig& rig, MarkerTrackerOptions options = {})
      : MarkerTracker(SimilarSkin(model, rig), options) {}

  /// Steps 1 to 3. `predicted_mm`: positions of all markers, link frame, as the frame before had them; empty:
  /// as at rest. To be followed by Check.
  void Follow(const Pictures& gray, std::span<const Vec3> predicted_mm, TrackingReport& report);
  /// Step 4. `labels`: this frame's.
  void Check(LabelledMarkers& labels, TrackingReport& report);

  /// After Check: the full pictures should be looked at, in this very frame.
  AcquireReason WantsAcquire() const { return wants_; }
  /// Takes labels from a search over the full pictures, for `gray`; `labels` then has what is kept of them.
  /// If the frame was followed too, the better of both results is kept, without labels in which they differ.
  void Adopt(const Pictures& gray, const LabelledMarkers& acquired, LabelledMarkers& labels,
             TrackingReport& report);
  /// A label that later stages don't believe: it is looked for again, where the prediction has it.
  void Reject(CameraId id, int marker) { Drop(cameras_[Index(id)].tracks[static_cast<size_t>(marker)]); }
  /// Where the untouched skin has the markers, link frame, by marker: displacements that contacts cause are
  /// counted from there. At first: as at rest.
  void SetUntouched(std::span<const Vec3> untouched_mm);
  /// Nothing is known of where the markers are.
  void Forget();

  /// In the last picture.
  int seen(CameraId id) const;

 private:
  MarkerTracker(const SimilarSkin& skin, MarkerTrackerOptions options);
  struct Size {  // of a marker's spot
    double width_px = 0, height_px = 0, area_px2 = 0, contrast = 0;
  };
  struct Track {  // one marker in one picture
    explicit Track(int patch_capacity) : patch(patch_capacity) {}
    Vec2 pixel = Vec2::Zero(), velocity = Vec2::Zero();  // velocity: px a frame
    Vec2 motion = Vec2::Zero();                          // the last one
    Vec2 checked = Vec2::Zero();   // where its geometry was checked last; while fresh, where it was expected
    Vec2 bias = Vec2::Zero();      // the detector's centre off the window's
    Vec2 residual = Vec2::Zero();  // off the projection of the predicted position, low-passed
    Vec2 expected = Vec2::Zero();  // while unseen: by the prediction; valid if `projects`
    Mat2 covariance = Mat2::Identity();  // while not clipped
    Size size;                           // in the reference
    double gain = 1;                     // of the light since then
    int missing = 0;                     // frames since it was seen
    bool lost_now = false;               // in this frame; `expected` is where its motion leads
    bool seen = false, known = false, clipped = false, projects = false;  // known: `size` was measured
    ReferencePatch patch;
  };
  struct Camera {
    std::vector<Track> tracks;  // by marker
    std::vector<Size> rest_sizes;
    std::vector<Vec2> rest_px;
    std::vector<double> scale_px_per_mm, rest_pitch_px, max_spread_px2;
    int seen_before = 0;
    int64_t pixels_read = 0;
    double contrast = 60;  // of a typical marker, gray levels
    bool has_picture = false, had_picture = false;
    bool learned = false;  // the residuals
  };

  void PrepareCamera(const LinkModel& model, CameraId id);
  template <typename Visit>
  void EachNeighbour(int marker, Visit visit) const {
    const int path = marker % paths_, ring = marker / paths_;
    const auto index = [&](int l, int j) {
      const int neighbour = j * paths_ + (l + paths_) % paths_;
      return static_cast<size_t>(neighbour);
    };
    visit(index(path - 1, ring));
    visit(index(path + 1, ring));
    if (ring > 0) visit(index(path, ring - 1));
    if (ring + 1 < rings_) visit(index(path, ring + 1));
  }
  double MaxSpread(const LinkModel& model, CameraId id, const Vec3& rest) const;
  double LocalPitch(const Camera& camera, int marker, const Vec2& pixel) const;
  double Reach(const Camera& camera, int marker, const Vec2& expected, double motion_mm) const;
  void FollowSeen(Camera& camera, const cv::Mat& gray, CameraTracking& counts);
  bool Verify(const cv::Mat& gray, Track& track, Camera& camera);
  bool MeasureAnew(const cv::Mat& gray, const Vec2& expected, double reach, double looseness, int marker,
                   Camera& camera);
  void TakeReference(const cv::Mat& gray, Track& track);
  static void MoveTo(const Vec2& pixel, Track& track);
  bool IsTurnToSearch(const Track& track, int marker) const;
  void Search(CameraId id, const cv::Mat& gray, CameraTracking& counts);
  void LearnResiduals(CameraId id);
  void ExpectUnseen(CameraId id);
  static void Drop(Track& track);
  static int CountSeen(const Camera& camera);

  void WriteLabels(LabelledMarkers& labels);
  void CheckAll(LabelledMarkers& labels, TrackingReport& report);
  void CheckMarker(int marker);
  bool IsAmbiguous(const Camera& camera, int marker) const;
  struct Place {  // where a marker should be in a picture: between these two, but for the error
    Vec2 begin = Vec2::Zero(), end = Vec2::Zero();
    double error_px = 0;
    bool valid = false;
  };
  bool HasLabel(CameraId id, int marker) const {
    const auto m = static_cast<size_t>(marker);
    return labelled_[Index(id)][m] != 0 && doubtful_[Index(id)][m] == 0;
  }
  double DisplacedPx(CameraId id, int marker) const;
  Place FindPlace(CameraId id, int marker) const;
  Place Along(CameraId id, int marker, const Vec3& at, const Vec3& begin, const Vec3& end,
              double error_px) const;
  double ZSlackMm(const Camera& camera, int marker, double displaced_px) const;
  bool IsFar(CameraId id, int rival, const Vec2& pixel, double touching_px) const;
  const Place& PlaceOf(CameraId id, int marker);
  bool IsSureOfRay(CameraId id, int marker) const;
  void DoubtRivalled();
  int DoubtRivalled(CameraId id, int path);
  bool MayBeAnother(CameraId id, int marker);
  void PredictFromLabels();
  std::optional<Vec3> OnItsRing(int marker) const;
  bool IsOnAnother(CameraId id, int marker) const;
  bool SingleHolds(CameraId id, int marker) const;
  int CountLostDisplaced(const Camera& camera) const;
  void JudgeLoss();
  void Take(Camera& camera, const cv::Mat& gray, int marker, const MarkerObservation& label);

  const MarkerTrackerOptions options_;
  const double scale_;  // of the SimilarSkin
  int paths_, rings_, count_;
  LabelCheck check_;
  WindowMeasure measure_;
  WindowBlob blob_;
  std::vector<Camera> cameras_;  // by camera
  std::vector<Vec3> rest_mm_;
  std::vector<double> pair_z_mm_;   // where both cameras' rays met when last checked; NaN: not known
  std::vector<Vec3> predicted_mm_;  // of the frame in work
  std::array<std::vector<Place>, kCameraCount> places_;
  std::array<std::vector<uint8_t>, kCameraCount> place_known_, labelled_;  // labelled_: before the checks
  std::array<std::vector<uint8_t>, kCameraCount> doubtful_, fresh_;  // by marker; fresh: found in this frame
  double noise2_ = 8;  // running median of the patches' residuals, gray levels squared
  int frame_ = 0, since_acquire_ = 0, retry_frames_ = 8;
  int seen_at_acquire_ = 0;
  bool followed_ = false;
  bool anew_ = false;  // the labels in check are of a full picture, and what is predicted comes from them
  AcquireReason wants_ = AcquireReason::kFirst;
};

}  // namespace taclink
