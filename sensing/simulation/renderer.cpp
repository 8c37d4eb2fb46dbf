#include "sensing/simulation/renderer.h"

#include <algorithm>
#include <cmath>
#include <numeric>
#include <random>

#include "sensing/simulation/occlusion.h"
#include "sensing/simulation/random.h"

namespace taclink {
namespace {

constexpr size_t kJitterTableSize = 8192;   // a power of two
constexpr size_t kNoiseOffsets = 1U << 17;  // frames start at one of so many places of the noise table
constexpr double kMarkerLevel = 235;        // right before the lens, facing it
constexpr double kHardlyDeformedMm = 0.5;   // shallower dents hide nothing
constexpr double kGrazeMm = 0.3;  // a wall this close to the line of sight hides less than half a marker

// Independent streams of one frame.
enum class Stream : uint64_t { kNoise = 1, kJitter = 2, kGain = 3 };

uint64_t FrameBits(uint64_t seed, uint64_t frame, CameraId id, Stream stream) {
  return MixBits(MixBits(MixBits(seed) + frame) + Index(id) * 16 + static_cast<uint64_t>(stream));
}

RadiusGrid RestWall(const LinkModel& model) {
  RadiusGrid wall;
  wall.columns = 1;
  constexpr int kRows = 128;
  for (int i = 0; i <= kRows; ++i) {
    const Vec3 p = model.PointAtDepth(0, model.length_mm * i / kRows, model.thickness_mm);
    wall.z_mm.push_back(p.z());
    wall.radius_mm.push_back(p.x());
  }
  wall.row_min_mm = wall.radius_mm;
  return wall;
}

std::vector<int> FarToNear(const std::vector<Vec3>& markers, const Vec3& camera_mm) {
  std::vector<int> order(markers.size());
  std::iota(order.begin(), order.end(), 0);
  std::stable_sort(order.begin(), order.end(), [&](int a, int b) {
    return (markers[static_cast<size_t>(a)] - camera_mm).squaredNorm() >
           (markers[static_cast<size_t>(b)] - camera_mm).squaredNorm();
  });
  return order;
}

}  // namespace

Renderer::Renderer(const LinkModel& model, const StereoRig& rig, const CameraEffects& effects, uint64_t seed)
    : dome_radius_mm_(model.markers.diameter_mm / 2),
      light_reach_mm_(1.6 * model.length_mm),
      effects_(effects),
      seed_(seed) {
  const RadiusGrid wall = RestWall(model);
  const std::vector<Vec3> markers = model.RestMarkers();
  size_t pixels = 0;
  for (const CameraId id : kBothCameras) {
    const Projector projector(rig[id]);
    Eye eye{projector,
            MakeBackground(model, rig[id], id, effects, MixBits(seed)),
            FarToNear(markers, projector.center_in_link()),
            false,
            Dirt(rig[id].width_px, rig[id].height_px, effects.dirt_specks, MixBits(seed + 17) + Index(id)),
            {},
            std::vector<Eye::Drawn>(markers.size())};
    eye.background.gray.copyTo(eye.markers);
    for (const Vec3& p : markers)
      eye.hides_at_rest = eye.hides_at_rest || IsHidden(wall, p, projector.center_in_link(), kGrazeMm);
    pixels = std::max(pixels, eye.background.gray.total());
    eyes_.push_back(std::move(eye));
  }
  std::mt19937_64 rng(MixBits(seed + 1));
  std::normal_distribution<double> normal;
  for (size_t i = 0; i < kJitterTableSize; ++i)
    jitter_px_.emplace_back(effects.marker_jitter_px * normal(rng), effects.marker_jitter_px * normal(rng));
  if (effects.sensor_noise_levels <= 0) return;
  noise_above_.resize(pixels + kNoiseOffsets);
  noise_below_.resize(pixels + kNoiseOffsets);
  for (size_t i = 0; i < noise_above_.size(); ++i) {
    const double level = std::clamp(std::round(effects.sensor_noise_levels * normal(rng)), -255.0, 255.0);
    noise_above_[i] = static_cast<uint8_t>(std::max(level, 0.0));
    noise_below_[i] = static_cast<uint8_t>(std::max(-level, 0.0));
  }
}

bool Renderer::Sees(const SkinTruth& truth, CameraId id, int marker) const {
  if (!truth.marker_is_lost.empty() && truth.marker_is_lost[static_cast<size_t>(marker)]) return false;
  const Eye& eye = eyes_[Index(id)];
  const bool may_hide = eye.hides_at_rest || truth.inner_wall.largest_inward_change_mm > kHardlyDeformedMm;
  const Vec3& p = truth.marker_mm[static_cast<size_t>(marker)];
  return !may_hide || !IsHidden(truth.inner_wall, p, eye.projector.center_in_link(), kGrazeMm);
}

Dome Renderer::MarkerDome(const SkinTruth& truth, CameraId id, int marker) const {
  const auto m = static_cast<size_t>(marker);
  Dome dome{truth.marker_wall_mm[m], truth.marker_normal[m], dome_radius_mm_};
  // The light falls off slowly: LEDs stand at both ends and the walls scatter.
  const double distance = (dome.foot_mm - eyes_[Index(id)].projector.center_in_link()).norm();
  dome.level = effects_.exposure * kMarkerLevel / (1 + distance / light_reach_mm_);
  if (effects_.marker_jitter_px > 0)
    dome.shift_px = jitter_px_[(FrameBits(seed_, truth.frame, id, Stream::kJitter) + m) % kJitterTableSize];
  return dome;
}

std::optional<Vec2> Renderer::Centroid(const SkinTruth& truth, CameraId id, int marker) const {
  const Dome dome = MarkerDome(truth, id, marker);
  const auto centroid = SilhouetteCentroid(eyes_[Index(id)].projector, dome);
  if (!centroid) return std::nullopt;
  return Vec2(*centroid + dome.shift_px);
}

double Renderer::Gain(const SkinTruth& truth, CameraId id) const {
  if (effects_.flicker <= 0) return 1;
  const uint64_t bits = FrameBits(seed_, truth.frame, id, Stream::kGain);
  // Box and Muller.
  const double radius = std::sqrt(-2 * std::log(1 - UnitFromBits(bits)));
  const double normal = radius * std::cos(2 * kPi * UnitFromBits(MixBits(bits)));
  return std::clamp(1 + effects_.flicker * normal, 0.2, 3.0);
}

// A dome that has changed, and whatever overlaps with one that is to be drawn again: edges are blended.
void Renderer::MarkStale(const SkinTruth& truth, CameraId id) {
  Eye& eye = eyes_[Index(id)];
  std::vector<Eye::Drawn>& all = eye.drawn;
  for (size_t m = 0; m < all.size(); ++m) {
    const auto marker = static_cast<int>(m);
    std::optional<Dome> dome;
    if (Sees(truth, id, marker)) dome = MarkerDome(truth, id, marker);
    all[m].is_stale = dome != all[m].dome;
    all[m].dome = dome;
    if (!all[m].is_stale) continue;
    // Where it will be is not drawn yet; what it covers there overlaps with it.
    if (dome) all[m].place |= DomePlace(eye.projector, *dome, effects_.blur_px, eye.markers.size());
  }
  for (bool is_more = true; is_more;) {
    is_more = false;
    for (const Eye::Drawn& stale : all) {
      if (!stale.is_stale || stale.place.empty()) continue;
      for (Eye::Drawn& other : all) {
        if (other.is_stale || (other.place & stale.place).empty()) continue;
        other.is_stale = is_more = true;
      }
    }
  }
}

void Renderer::DrawMarkers(const SkinTruth& truth, CameraId id) {
  Eye& eye = eyes_[Index(id)];
  MarkStale(truth, id);
  for (const Eye::Drawn& each : eye.drawn) {
    if (each.is_stale && !each.place.empty()) eye.background.gray(each.place).copyTo(eye.markers(each.place));
  }
  for (const int marker : eye.far_to_near) {
    Eye::Drawn& each = eye.drawn[static_cast<size_t>(marker)];
    if (!each.is_stale) continue;
    each.place = {};
    if (each.dome) each.place = DrawDome(eye.projector, *each.dome, effects_.blur_px, eye.markers);
  }
}

void Renderer::Render(const SkinTruth& truth, CameraId id, cv::Mat& gray) {
  const Eye& eye = eyes_[Index(id)];
  DrawMarkers(truth, id);
  eye.markers.copyTo(gray);
  eye.dirt.CoverLens(gray);
  if (effects_.flicker > 0) gray.convertTo(gray, CV_8U, Gain(truth, id));
  if (noise_above_.empty()) return;
  const size_t offset = FrameBits(seed_, truth.frame, id, Stream::kNoise) % kNoiseOffsets;
  // OpenCV takes its inputs as non-const; it does not write them.
  const auto noise = [&](const std::vector<uint8_t>& table) {
    return cv::Mat(gray.rows, gray.cols, CV_8U, const_cast<uint8_t*>(table.data() + offset));
  };
  cv::add(gray, noise(noise_above_), gray);
  cv::subtract(gray, noise(noise_below_), gray);
}

void PackYuyv(const cv::Mat& gray, const cv::Mat& chroma, RawImage& image) {
  image.format = PixelFormat::kYuyv;
  image.width_px = gray.cols;
  image.height_px = gray.rows;
  image.bytes.resize(2 * gray.total());
  image.valid = true;
  // YUYV is a picture of two channels: brightness, and U and V in turn.
  cv::Mat yuyv(gray.rows, gray.cols, CV_8UC2, image.bytes.data());
  if (chroma.empty()) {
    yuyv.setTo(cv::Scalar::all(128));
    cv::insertChannel(gray, yuyv, 0);
  } else {
    const std::array<cv::Mat, 2> channels = {gray, chroma};
    cv::merge(channels.data(), channels.size(), yuyv);
  }
}

}  // namespace taclink
