#include "sensing/simulation/background.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <opencv2/imgproc.hpp>
#include <random>

namespace taclink {
namespace {

// Levels and proportions read off a real picture of the barrel.
constexpr double kOpening = 0.8;       // radius of the far LED ring over that of the wall there
constexpr double kRimDistance = 0.25;  // of the near rim from the clamped end, over the first ring's
constexpr double kOpeningLevel = 18;   // black camera housing inside the LED ring
constexpr double kHousingLevel = 5;    // outside the near rim
constexpr double kSkinLevel = 19;      // at both ends; lit more in between
constexpr double kSkinRise = 13;
constexpr double kRingLevel = 290;
constexpr double kGlowLevel = 70;    // beside the ring
constexpr double kGlowReach = 0.55;  // over the ring's radius in the picture
constexpr double kRimFade = 9;       // px

// A sum of a few random waves around the circle, scaled to [0, 1]; a table, as every pixel asks.
class Ripple {
 public:
  Ripple(std::mt19937_64& rng, int lowest, int highest) {
    std::uniform_real_distribution<double> phase(0, 2 * kPi), size(0.3, 1);
    std::array<double, kBins> sum{};
    double total = 0;
    for (int n = lowest; n <= highest; ++n) {
      const double height = size(rng), start = phase(rng);
      total += height;
      for (size_t i = 0; i < kBins; ++i)
        sum[i] += height * std::sin(n * 2 * kPi * static_cast<double>(i) / kBins + start);
    }
    for (size_t i = 0; i < kBins; ++i) table_[i] = std::clamp(0.5 + 0.9 * sum[i] / total, 0.0, 1.0);
  }
  double At(double angle) const {
    return table_[static_cast<size_t>((angle / (2 * kPi) + 1) * kBins) % kBins];
  }

 private:
  static constexpr size_t kBins = 1024;
  std::array<double, kBins> table_;
};

// A circle around the link's axis as the camera sees it.
class PictureCircle {
 public:
  PictureCircle(const Projector& camera, double z_mm, double radius_mm) {
    center_ = camera.Project({0, 0, z_mm}).value_or(camera.model().lens.principal_point_px);
    const double beyond = 2.0 * std::hypot(camera.model().width_px, camera.model().height_px);
    radius_px_.fill(beyond);
    constexpr int kSamples = 720;
    for (int i = 0; i < kSamples; ++i) {
      const double angle = 2 * kPi * i / kSamples;
      const auto p = camera.Project({radius_mm * std::cos(angle), radius_mm * std::sin(angle), z_mm});
      if (p) radius_px_[Bin(*p - center_)] = (*p - center_).norm();
    }
  }
  /// Distance outward, px.
  double Outside(const Vec2& p) const { return (p - center_).norm() - radius_px_[Bin(p - center_)]; }
  double Angle(const Vec2& p) const { return std::atan2(p.y() - center_.y(), p.x() - center_.x()); }
  double radius_px() const { return radius_px_[0]; }

 private:
  static constexpr size_t kBins = 360;
  static size_t Bin(const Vec2& d) {
    const double turns = std::atan2(d.y(), d.x()) / (2 * kPi) + 1;
    return static_cast<size_t>(turns * kBins) % kBins;
  }
  Vec2 center_;
  std::array<double, kBins> radius_px_;
};

double Bell(double x) {
  return std::exp(-x * x);
}

// Two arcs of the near rim reflect the LEDs.
double ArcWindow(double angle) {
  const double off = std::abs(std::abs(angle) - RadFromDeg(150));  // left, above and below
  const double right = std::abs(angle + RadFromDeg(32));
  const double left = angle < 0 ? off : off + RadFromDeg(25);
  return std::max(Bell(left / RadFromDeg(20)), Bell(right / RadFromDeg(13)));
}

// Faint smears: reflections of the markers in the tube and on the skin; and a few specks of dust.
void AddSmears(const PictureCircle& far_ring, const PictureCircle& rim, std::mt19937_64& rng,
               cv::Mat& level) {
  std::uniform_real_distribution<double> unit(0, 1);
  const double ring_px = far_ring.radius_px();
  const double rim_px = std::min(rim.radius_px(), 0.5 * std::hypot(level.cols, level.rows));
  const Vec2 center(level.cols / 2.0, level.rows / 2.0);
  for (int i = 0; i < 110; ++i) {
    const bool dust = i < 14;
    const double angle = 2 * kPi * unit(rng), radius = ring_px + (rim_px - ring_px) * std::sqrt(unit(rng));
    const Vec2 out(std::cos(angle), std::sin(angle));
    const double thick = dust ? 0.8 : 3 + 0.03 * radius * unit(rng),
                 length = thick * (dust ? 1.5 : 2.2 + 2 * unit(rng));
    const double height = dust ? 25 * unit(rng) : 13 * unit(rng);
    const Vec2 at = center + radius * out;
    const int reach = static_cast<int>(3 * length) + 1;
    const int left = static_cast<int>(at.x()), top = static_cast<int>(at.y());
    for (int y = std::max(0, top - reach); y < std::min(level.rows, top + reach); ++y) {
      for (int x = std::max(0, left - reach); x < std::min(level.cols, left + reach); ++x) {
        const Vec2 d = Vec2(x, y) - at;
        const double across = d.dot(out) / thick, along = (d.x() * out.y() - d.y() * out.x()) / length;
        level.at<float>(y, x) += static_cast<float>(height * std::exp(-across * across - along * along));
      }
    }
  }
}

struct PixelLook {
  double level = 0, u = 0, v = 0;  // u, v: colour, 0 is grey
};

struct Surroundings {
  PictureCircle far_ring, rim;
  Ripple glow, ring, streaks;
  const CameraEffects& effects;

  PixelLook At(const Vec2& p, double smear) const {
    const double d = far_ring.Outside(p), beyond_rim = rim.Outside(p);
    if (d < 0) return {kOpeningLevel + RingLight(d, p), 0, 0};
    const double angle = far_ring.Angle(p);
    const double share = d / std::max(1.0, d - beyond_rim);
    const double lit = Bell((share - 0.62) / 0.38) * (0.75 + 0.5 * streaks.At(angle));
    const double reach = kGlowReach * far_ring.radius_px();
    const double halo = effects.glow * kGlowLevel * std::exp(-d / reach) * (0.25 + 1.1 * glow.At(angle));
    PixelLook look{kSkinLevel + kSkinRise * lit + halo + smear + RingLight(d, p), 0.05 * halo,
                   (0.06 + 0.26 * streaks.At(angle)) * halo};
    if (beyond_rim > 0) {
      const double inner = std::exp(-beyond_rim / kRimFade);
      look.level = kHousingLevel + inner * (look.level - kHousingLevel);
    }
    const double arc = ArcWindow(rim.Angle(p));
    const double red = arc * Bell((beyond_rim - 3) / 2.2), white = arc * arc * Bell((beyond_rim - 7) / 2.5);
    look.level += 70 * red + 215 * white;
    look.u += 2 * white - 8 * red;
    look.v += 52 * red;
    return look;
  }

  double RingLight(double d, const Vec2& p) const {
    return effects.glow * kRingLevel * Bell((d - 1.0) / 1.15) * (0.1 + 1.0 * ring.At(far_ring.Angle(p)));
  }
};

}  // namespace

Background MakeBackground(const LinkModel& model, const CameraModel& camera, CameraId id,
                          const CameraEffects& effects, uint64_t seed) {
  const Projector projector(camera);
  const bool top = id == CameraId::kTop;
  const double first = model.markers.rings_z_mm.front(), last = model.markers.rings_z_mm.back();
  const double rim_z = top ? kRimDistance * first : model.length_mm - kRimDistance * (model.length_mm - last);
  const double far_z = top ? model.length_mm : 0;
  const auto wall = [&](double z) { return model.PointAtDepth(0, z, model.thickness_mm).head<2>().norm(); };
  std::mt19937_64 rng(seed + Index(id));
  const Surroundings around{PictureCircle(projector, far_z, kOpening * wall(far_z)),
                            PictureCircle(projector, rim_z, wall(rim_z)),
                            Ripple(rng, 1, 9),
                            Ripple(rng, 1, 5),
                            Ripple(rng, 3, 24),
                            effects};
  cv::Mat smears = cv::Mat::zeros(camera.height_px, camera.width_px, CV_32F);
  AddSmears(around.far_ring, around.rim, rng, smears);

  Background background;
  cv::Mat level(camera.height_px, camera.width_px, CV_32F);
  background.chroma.create(camera.height_px, camera.width_px, CV_8U);
  const double corner = 0.5 * std::hypot(camera.width_px, camera.height_px);
  for (int y = 0; y < level.rows; ++y) {
    for (int x = 0; x < level.cols; ++x) {
      const Vec2 p(x, y);
      const PixelLook look = around.At(p, static_cast<double>(smears.at<float>(y, x)));
      const double off = (p - camera.lens.principal_point_px).norm() / corner;
      const double dim = 1 - 0.35 * std::min(effects.vignetting, 2.0) * off * off;
      level.at<float>(y, x) = static_cast<float>(effects.exposure * std::max(0.0, dim) * look.level);
      const double colour = 128 + std::min(1.0, effects.exposure) * (x % 2 == 0 ? look.u : look.v);
      background.chroma.at<uint8_t>(y, x) = static_cast<uint8_t>(std::clamp(colour, 0.0, 255.0));
    }
  }
  if (effects.blur_px > 0) cv::GaussianBlur(level, level, cv::Size(), effects.blur_px);
  level.convertTo(background.gray, CV_8U);
  return background;
}

}  // namespace taclink
