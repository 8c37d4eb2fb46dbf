#include "sensing/simulation/dome.h"

#include <algorithm>
#include <cmath>

#include "sensing/shell/instructions.h"

namespace taclink {
namespace {

constexpr double kPixelVariance = 1.0 / 12;     // of a square pixel's own averaging, px^2
constexpr double kSmoothstepHalfWidth = 2.236;  // of the smoothstep that has a Gaussian's variance, in sigmas
constexpr double kLeastFacing = 0.02;           // flatter sights of the wall draw the dome's profile alone
constexpr double kHiddenFacing = -0.1;          // the wall turns away
constexpr double kAmbient = 0.80;               // light from everywhere: the walls scatter it
constexpr double kLightAside = 0.6;             // the LEDs stand beside the lens, nearer to the wall

// The dome in the plane across the line of sight, with the unit of length mm: u towards the dome's top, w
// across. Seen is the union of the half disc u > 0 and the half of the base's ellipse u < 0, whose half axis
// is radius * facing.
struct DomeSight {
  Vec2 foot_px;     // u = w = 0
  Mat2 px_from_mm;  // columns: u, w
  double facing;    // cosine between the wall's inward normal and the line of sight
};

bool Look(const Projector& camera, const Dome& dome, DomeSight& sight) {
  const Vec3 inward = -dome.normal;
  const Vec3 to_camera = (camera.center_in_link() - dome.foot_mm).normalized();
  sight.facing = inward.dot(to_camera);
  if (sight.facing < kHiddenFacing) return false;
  sight.facing = std::max(sight.facing, kLeastFacing);
  const Vec3 across = inward - inward.dot(to_camera) * to_camera;
  const double sine = across.norm();
  const Vec3 up = sine > 1e-6 ? Vec3(across / sine) : to_camera.unitOrthogonal();
  // The affine image is taken where the silhouette's centroid is, so that it errs there least.
  const double rise = 4 * dome.radius_mm / (3 * kPi) * (1 - sight.facing) / 2;
  const auto seen = camera.ProjectWithJacobian(dome.foot_mm + rise * up);
  if (!seen) return false;
  sight.px_from_mm.col(0) = seen->jacobian * up;
  sight.px_from_mm.col(1) = seen->jacobian * to_camera.cross(up);
  sight.foot_px = seen->pixel - rise * sight.px_from_mm.col(0) + dome.shift_px;
  return std::abs(sight.px_from_mm.determinant()) > 1e-9;
}

double HalfWidth(double blur_px) {
  return kSmoothstepHalfWidth * std::sqrt(blur_px * blur_px + kPixelVariance);
}

cv::Rect PlaceOf(const DomeSight& sight, double radius_mm, double half_width, cv::Size size) {
  const Vec2 extent = radius_mm * sight.px_from_mm.rowwise().norm() + Vec2::Constant(half_width + 1);
  if (!extent.allFinite() || !sight.foot_px.allFinite()) return {};
  const auto clip = [](double v, int most) {
    return static_cast<int>(std::clamp(std::ceil(v), 0.0, static_cast<double>(most)));
  };
  const cv::Point from(clip(sight.foot_px.x() - extent.x(), size.width),
                       clip(sight.foot_px.y() - extent.y(), size.height)),
      to(clip(sight.foot_px.x() + extent.x(), size.width), clip(sight.foot_px.y() + extent.y(), size.height));
  return {from, to};
}

}  // namespace

std::optional<Vec2> SilhouetteCentroid(const Projector& camera, const Dome& dome) {
  DomeSight sight;
  if (!Look(camera, dome, sight)) return std::nullopt;
  const double rise = 4 * dome.radius_mm / (3 * kPi) * (1 - sight.facing);
  return sight.foot_px - dome.shift_px + rise * sight.px_from_mm.col(0);
}

cv::Rect DomePlace(const Projector& camera, const Dome& dome, double blur_px, cv::Size size) {
  DomeSight sight;
  if (!Look(camera, dome, sight)) return {};
  return PlaceOf(sight, dome.radius_mm, HalfWidth(blur_px), size);
}

namespace {

// A dome in units of its radius, in floats: this is most of a picture's cost.
struct Drawing {
  float u_by_x, u_by_y, w_by_x, w_by_y;  // by a pixel
  float facing, px_by_u, soft;           // soft: edges per px
  float ambient, direct;                 // levels
};

// Pixels of a row from where u and w are given. Without branches or aliases, so that the compiler makes it of
// vectors.
TACLINK_IN_KERNEL void DrawPixels(const Drawing d, float u0, float w0, int count, uint8_t* __restrict row) {
  constexpr auto kAside = static_cast<float>(kLightAside);
  for (int i = 0; i < count; ++i) {
    const float x = static_cast<float>(i), u = u0 + d.u_by_x * x, w = w0 + d.w_by_x * x;
    // Signed distances, px, to the ball's outline, (1 - q) over the gradient of q, and to the base's lower
    // edge.
    const float q2 = u * u + w * w + 1e-6F;
    const float gx = u * d.u_by_x + w * d.w_by_x, gy = u * d.u_by_y + w * d.w_by_y;
    const float to_outline = (1 - std::sqrt(q2)) * std::sqrt(q2 / (gx * gx + gy * gy + 1e-12F));
    const float to_base = (u + d.facing * std::sqrt(std::max(0.0F, 1 - w * w))) * d.px_by_u;
    const float t = std::clamp(0.5F + std::min(to_outline, to_base) * d.soft, 0.0F, 1.0F);
    const float cover = t * t * (3 - 2 * t);
    const float front = std::sqrt(std::max(0.0F, 1 - u * u - w * w));
    const float shade = d.ambient + d.direct * std::max(0.0F, front - kAside * u);
    const float before = static_cast<float>(row[i]), value = before + cover * (shade - before);
    row[i] = static_cast<uint8_t>(std::clamp(value + 0.5F, 0.0F, 255.0F));
  }
}

void DrawPixelsPlain(const Drawing& d, float u0, float w0, int count, uint8_t* row) {
  DrawPixels(d, u0, w0, count, row);
}
TACLINK_FOR_AVX2 void DrawPixelsAvx2(const Drawing& d, float u0, float w0, int count, uint8_t* row) {
  DrawPixels(d, u0, w0, count, row);
}

}  // namespace

cv::Rect DrawDome(const Projector& camera, const Dome& dome, double blur_px, cv::Mat& gray) {
  DomeSight sight;
  if (!Look(camera, dome, sight)) return {};
  const double half_width = HalfWidth(blur_px);
  const cv::Rect place = PlaceOf(sight, dome.radius_mm, half_width, gray.size());
  const Eigen::Matrix2f m = (sight.px_from_mm.inverse() / dome.radius_mm).cast<float>();
  const double light_norm = 1 / std::hypot(1.0, kLightAside);
  const Drawing drawing{.u_by_x = m(0, 0),
                        .u_by_y = m(0, 1),
                        .w_by_x = m(1, 0),
                        .w_by_y = m(1, 1),
                        .facing = static_cast<float>(sight.facing),
                        .px_by_u = 1 / std::hypot(m(0, 0), m(0, 1)),
                        .soft = static_cast<float>(0.5 / half_width),
                        .ambient = static_cast<float>(kAmbient * dome.level),
                        .direct = static_cast<float>((1 - kAmbient) * dome.level * light_norm)};
  static const auto kDraw = BestInstructions() == Instructions::kPlain ? DrawPixelsPlain : DrawPixelsAvx2;
  for (int y = place.y; y < place.y + place.height; ++y) {
    const auto dx = static_cast<float>(place.x - sight.foot_px.x()),
               dy = static_cast<float>(y - sight.foot_px.y());
    kDraw(drawing, m(0, 0) * dx + m(0, 1) * dy, m(1, 0) * dx + m(1, 1) * dy, place.width,
          gray.ptr<uint8_t>(y) + place.x);
  }
  return place;
}

}  // namespace taclink
