#pragma once

#include <array>
#include <cstdint>
#include <opencv2/core.hpp>
#include <optional>
#include <vector>

#include "sensing/camera/projection.h"
#include "sensing/core/frame.h"
#include "sensing/core/link_model.h"
#include "sensing/simulation/background.h"
#include "sensing/simulation/dirt.h"
#include "sensing/simulation/dome.h"
#include "sensing/simulation/scene.h"
#include "sensing/simulation/skin_truth.h"

namespace taclink {

/// Makes the pictures that a link's cameras take of a skin. A picture depends on the truth (its frame number
/// picks the noise) and the seed alone. Markers are drawn again only where something has changed since the
/// last picture. Allocates nothing once its pictures are made. One thread.
class Renderer {
 public:
  Renderer(const LinkModel& model, const StereoRig& rig, const CameraEffects& effects, uint64_t seed);
  // A copy would share the pictures.
  Renderer(Renderer&&) = default;
  Renderer& operator=(Renderer&&) = default;

  /// 8-bit brightness as the sensor delivers it.
  void Render(const SkinTruth& truth, CameraId id, cv::Mat& gray);

  /// Whether the camera can see the marker at all: not broken off, not behind the skin, in front of the lens.
  bool Sees(const SkinTruth& truth, CameraId id, int marker) const;

  /// Where the centroid of a marker's outline is in the picture, its jitter included. Says nothing of what
  /// hides it. None: the marker turns its back, or is beyond the lens.
  std::optional<Vec2> Centroid(const SkinTruth& truth, CameraId id, int marker) const;

  /// The picture's gain, as the light flickers.
  double Gain(const SkinTruth& truth, CameraId id) const;

  /// Colour of the surroundings, for PackYuyv.
  const cv::Mat& chroma(CameraId id) const { return eyes_[Index(id)].background.chroma; }

 private:
  struct Eye {
    Projector projector;
    Background background;
    std::vector<int> far_to_near;  // marker indices in drawing order
    bool hides_at_rest = false;    // the undeformed wall already hides a marker
    Dirt dirt;
    // The last picture before dirt, flicker and noise, and what is drawn in it; by marker.
    struct Drawn {
      std::optional<Dome> dome;  // none: hidden
      cv::Rect place;            // empty: nowhere in the picture
      bool is_stale = false;     // to be drawn again
    };
    cv::Mat markers;
    std::vector<Drawn> drawn;
  };

  void MarkStale(const SkinTruth& truth, CameraId id);
  void DrawMarkers(const SkinTruth& truth, CameraId id);
  Dome MarkerDome(const SkinTruth& truth, CameraId id, int marker) const;

  double dome_radius_mm_;
  double light_reach_mm_;
  CameraEffects effects_;
  uint64_t seed_;
  std::vector<Eye> eyes_;                           // by camera
  std::vector<Vec2> jitter_px_;                     // a table of Gaussian shifts
  std::vector<uint8_t> noise_above_, noise_below_;  // Gaussian noise split by sign
};

/// YUYV bytes from brightness and colour (`chroma` as in Background; empty: grey). Reuses the image's buffer.
void PackYuyv(const cv::Mat& gray, const cv::Mat& chroma, RawImage& image);

}  // namespace taclink
