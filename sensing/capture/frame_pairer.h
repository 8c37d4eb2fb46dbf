#pragma once

#include <algorithm>
#include <array>
#include <cstdint>
#include <optional>
#include <span>

#include "sensing/core/camera_model.h"

namespace taclink {

/// One picture as the driver announced it.
struct PictureTag {
  uint32_t sequence = 0;     ///< the driver's count of exposures of this camera; wraps
  int64_t timestamp_ns = 0;  ///< the driver's, CLOCK_MONOTONIC
  int handle = 0;            ///< the caller's own, handed back with the picture: a buffer's index
};

/// Two pictures of one moment, or one while the other camera is lost.
struct FramePair {
  uint64_t sequence = 0;  ///< counts exposures of the top camera; rises, a gap is a pair that was lost
  std::array<PictureTag, kCameraCount> pictures;
  std::array<bool, kCameraCount> present = {true, true};  ///< at least one

  const PictureTag& operator[](CameraId id) const { return pictures[Index(id)]; }
  bool has(CameraId id) const { return present[Index(id)]; }
  bool is_whole() const { return present[0] && present[1]; }
  /// Of the earlier one.
  int64_t exposure_ns() const {
    if (!is_whole()) return pictures[present[0] ? 0 : 1].timestamp_ns;
    return std::min(pictures[0].timestamp_ns, pictures[1].timestamp_ns);
  }
};

/// Finds which pictures of two free-running cameras belong together: those whose timestamps are at most half
/// a frame apart. The cameras may have any constant offset and slightly different rates; when they have
/// drifted by more than half a frame, the neighbour becomes the partner. A frame is what the cameras really
/// take (low light makes some slower than asked), measured from the timestamps, of the faster camera.
///
/// Pictures of one camera come in order; those of the two may be interleaved in any way, as long as one is
/// not more than kDepth pictures late. A timestamp that does not rise within a camera starts again. While one
/// camera is lost each picture of the other is a pair of its own. Allocates nothing.
class FramePairer {
 public:
  /// How many pictures of a camera wait for a partner; the caller's buffers must allow for that.
  static constexpr size_t kDepth = 2;
  /// Once paired one way round, two cameras stay so until this much beyond half a frame: at an offset of just
  /// half a frame jitter would otherwise change the partner, and cost a picture, at every frame.
  static constexpr double kHysteresisFrames = 0.05;

  struct Dropped {
    CameraId camera = CameraId::kTop;
    PictureTag picture;
  };

  explicit FramePairer(double frame_rate_hz);

  /// A new picture. Returns the pair that it completes. A lost camera is back with its first picture.
  std::optional<FramePair> Add(CameraId camera, const PictureTag& picture);

  /// From this camera comes nothing for now: the other one does not wait for it.
  void Lose(CameraId camera);
  bool lost(CameraId camera) const { return cameras_[Index(camera)].lost; }

  /// Those that the last Add or Lose found to have no partner; valid until the next one.
  std::span<const Dropped> dropped() const { return {dropped_.data(), dropped_count_}; }

  /// Both cameras begin again, with sequences and handles of their own; nothing waits any more, none is lost.
  /// The sequence of the pairs goes on, with a gap as long as the time that has passed.
  void Restart();

  uint64_t dropped_total(CameraId camera) const { return cameras_[Index(camera)].dropped_total; }
  double frame_interval_ns() const;  ///< as measured
  /// How far apart the pictures were that were last found not to match; none since the last pair.
  std::optional<int64_t> mismatch_ns() const { return mismatch_ns_; }
  double interval_ns(CameraId camera) const { return cameras_[Index(camera)].interval_ns; }

 private:
  struct Camera {
    std::array<PictureTag, kDepth> waiting;  ///< oldest first
    size_t waiting_count = 0;
    std::optional<PictureTag> newest;
    double interval_ns = 0;
    uint64_t dropped_total = 0;
    bool lost = false;
    bool restarted = false;  ///< since last_pair_: its count may have begun again
  };

  void Follow(Camera& camera, const PictureTag& picture);
  void DropOldest(CameraId camera);
  void DropAll(CameraId camera);
  void Forget(Camera& camera) const;
  static PictureTag TakeOldest(Camera& camera);
  bool Match(int64_t bottom_minus_top_ns) const;
  FramePair MakePair();
  FramePair MakeAlone(CameraId camera);
  FramePair Count(FramePair pair);
  uint64_t Step(const FramePair& pair) const;

  const double nominal_interval_ns_;
  std::array<Camera, kCameraCount> cameras_;
  std::array<Dropped, kCameraCount * kDepth + 1> dropped_;
  size_t dropped_count_ = 0;
  std::optional<FramePair> last_pair_;
  std::optional<int64_t> mismatch_ns_;
};

}  // namespace taclink
