#include "bench/whole/whole_pictures.h"

#include <algorithm>
#include <cmath>
#include <opencv2/imgproc.hpp>
#include <random>
#include <utility>

namespace taclink {
namespace {

CameraEffects Moved(const WholeScene& whole) {
  CameraEffects effects = whole.scene.camera;
  const LinkFault& fault = whole.fault;
  for (size_t i = 0; i < kCameraCount; ++i) {
    if (!fault.cameras[i]) continue;
    if (fault.pictures == PictureFault::kMoved) effects.mount[i].shift_mm.x() += fault.amount;
    if (fault.pictures == PictureFault::kTurned) effects.mount[i].turn_rad.x() += RadFromDeg(fault.amount);
  }
  return effects;
}

Renderer MakeRenderer(const LinkModel& model, const WholeScene& whole, const CameraEffects& effects) {
  return {model, MountedRig(model.nominal_rig, effects), effects, whole.scene.seed};
}

bool IsCompressed(PictureFault fault) {
  return fault == PictureFault::kJpeg || fault == PictureFault::kReencoded;
}

void Warp(cv::Mat& gray, double turn_deg, double scale, double shift_px, double shift_y_px = 0) {
  const cv::Point2f middle(static_cast<float>(gray.cols - 1) / 2, static_cast<float>(gray.rows - 1) / 2);
  cv::Mat by = cv::getRotationMatrix2D(middle, turn_deg, scale);
  by.at<double>(0, 2) += shift_px;
  by.at<double>(1, 2) += shift_y_px;
  cv::Mat warped;
  cv::warpAffine(gray, warped, by, gray.size(), cv::INTER_CUBIC, cv::BORDER_CONSTANT);
  gray = std::move(warped);
}

// Light by place; x and y from -1 to 1.
template <typename Light>
void Shade(cv::Mat& gray, Light light) {
  for (int row = 0; row < gray.rows; ++row) {
    for (int column = 0; column < gray.cols; ++column) {
      uchar& pixel = gray.at<uchar>(row, column);
      const double x = 2.0 * column / (gray.cols - 1) - 1, y = 2.0 * row / (gray.rows - 1) - 1;
      pixel = cv::saturate_cast<uchar>(light(x, y, static_cast<double>(pixel)));
    }
  }
}

// Exchanges left and right.
void Mirror(cv::Mat& gray) {
  cv::Mat mirrored;
  cv::flip(gray, mirrored, 1);
  gray = std::move(mirrored);
}

// A hair close to the lens, out of focus, on an arc across the image.
void AddHair(cv::Mat& gray, double width_px) {
  Shade(gray, [&](double x, double y, double level) {
    const double off_px = (y + 0.45 - 0.25 * x * x) * gray.rows / 2;
    return level * (1 - 0.8 * std::exp(-off_px * off_px / (width_px * width_px)));
  });
}

// Magnified most in its middle, beside the image's middle, where the markers of a few rings are.
void AddDrop(cv::Mat& gray, double radius_px) {
  constexpr float kMagnified = 0.35F;
  const cv::Point2f at(0.68F * static_cast<float>(gray.cols), 0.5F * static_cast<float>(gray.rows));
  cv::Mat from(gray.size(), CV_32FC2);
  for (int row = 0; row < gray.rows; ++row) {
    for (int column = 0; column < gray.cols; ++column) {
      const cv::Point2f pixel(static_cast<float>(column), static_cast<float>(row));
      const cv::Point2f off = pixel - at;
      const float part = off.dot(off) / static_cast<float>(radius_px * radius_px);
      from.at<cv::Point2f>(row, column) = part < 1 ? pixel - kMagnified * (1 - part) * off : pixel;
    }
  }
  cv::Mat seen;
  cv::remap(gray, seen, from, {}, cv::INTER_CUBIC, cv::BORDER_REPLICATE);
  gray = std::move(seen);
}

void AddNoise(cv::Mat& gray, double levels, unsigned seed) {
  std::mt19937 random(seed);
  std::normal_distribution<float> normal(0, static_cast<float>(levels));
  Shade(gray, [&](double, double, double level) { return level + normal(random); });
}

}  // namespace

// Its skin is pressed elsewhere.
Scene OtherLinksScene(const WholeScene& whole) {
  Scene scene = whole.scene;
  scene.name += ", another link";
  scene.contacts.clear();
  SceneContact& contact = scene.contacts.emplace_back();
  contact.at = {.path = 0, .ring = 0, .angle_rad = RadFromDeg(-60), .z_mm = 80};
  contact.patch_diameter_mm = 11;
  contact.force_n = 0.4;
  contact.begin_s = 2;
  contact.end_s = scene.duration_s + 1;
  contact.ramp_s = 0.5;
  contact.where = scene.name;
  return scene;
}

WholePictures::WholePictures(const LinkModel& model, const WholeScene& whole, SimulatedSkin& skin,
                             SimulatedSkin* other)
    : whole_(whole),
      skin_(skin),
      other_(whole.fault.pictures == PictureFault::kCrossed ? other : nullptr),
      aging_(model, whole.fault.aging, whole.scene.duration_s),
      renderer_(MakeRenderer(model, whole, whole.scene.camera)),
      moved_(MakeRenderer(model, whole, Moved(whole))) {}

void WholePictures::Draw(Renderer& renderer, int frame, const SkinTruth& truth, CameraId id) {
  cv::Mat& gray = gray_[Index(id)];
  SkinTruth seen = truth;
  seen.frame = static_cast<uint64_t>(frame);  // which picks the noise: a late picture has its own
  renderer.Render(seen, id, gray);
}

// What happens to the light, or after the lens.
void WholePictures::Spoil(int frame, CameraId id, cv::Mat& gray) {
  const LinkFault& fault = whole_.fault;
  const double time_s = frame / whole_.scene.frame_rate_hz;
  const double grown =
      fault.grows_s > 0 ? std::clamp((time_s - std::max(0.0, fault.begin_s)) / fault.grows_s, 0.0, 1.0) : 1;
  // Of light, the amount is what is left.
  const double amount =
      fault.pictures == PictureFault::kDark ? 1 - grown * (1 - fault.amount) : grown * fault.amount;
  const auto seed = static_cast<unsigned>(2 * frame + static_cast<int>(Index(id)));
  switch (fault.pictures) {
    case PictureFault::kRolled:
      return Warp(gray, amount, 1, 0);
    case PictureFault::kShifted:
      return Warp(gray, 0, 1, amount);
    case PictureFault::kScaled:
      return Warp(gray, 0, 1 + grown * (fault.amount - 1), 0);
    case PictureFault::kBlended: {
      cv::Mat& blended = blended_[Index(id)];
      if (blended.empty()) gray.convertTo(blended, CV_32F);
      cv::accumulateWeighted(gray, blended, 1 - amount);
      return blended.convertTo(gray, CV_8U);
    }
    case PictureFault::kVibrating: {
      std::mt19937 random(static_cast<unsigned>(frame));
      std::uniform_real_distribution<double> shift_px(-amount, amount);
      const double x = shift_px(random);
      return Warp(gray, 0, 1, x, shift_px(random));
    }
    case PictureFault::kHair:
      return AddHair(gray, amount);
    case PictureFault::kDrop:
      return AddDrop(gray, amount);
    case PictureFault::kMirrored:
      return Mirror(gray);
    case PictureFault::kHazed: {
      const double mean = cv::mean(gray)[0];
      return Shade(gray,
                   [&](double, double, double level) { return (1 - amount) * level + amount * (mean + 40); });
    }
    case PictureFault::kBlurred:
      if (amount > 0) cv::GaussianBlur(gray, gray, {}, amount);
      return AddNoise(gray, whole_.scene.camera.sensor_noise_levels, seed);
    case PictureFault::kCovered:
      return Shade(gray,
                   [&](double x, double, double level) { return x < 2 * amount - 1 ? 0.05 * level : level; });
    case PictureFault::kDark:
      Shade(gray, [&](double, double, double level) { return amount * level; });
      return AddNoise(gray, whole_.scene.camera.sensor_noise_levels, seed);
    case PictureFault::kNoisy:
      return AddNoise(gray, amount, seed);
    case PictureFault::kDarkSide:
      return Shade(gray, [&](double x, double, double level) {
        return level * (amount + (1 - amount) * std::min(1.0, std::max(0.0, (x + 0.7) / 1.4)));
      });
    case PictureFault::kFalloff:
      return Shade(gray, [&](double x, double y, double level) {
        return level * std::pow(amount, std::max(0.0, 1 - std::hypot(x, y)));
      });
    case PictureFault::kGlow:
      return Shade(gray, [&](double x, double y, double level) {
        const double px = std::hypot(x * gray.cols, y * gray.rows) / 2;
        return level + 180 * std::exp(-0.5 * px * px / (amount * amount));
      });
    case PictureFault::kRim:
      return Shade(gray, [&](double x, double y, double level) {
        const double around = std::abs(std::atan2(y, x)) / kPi, off = (std::hypot(x, y) - 0.93) / 0.015;
        return around < amount ? level + 200 * std::exp(-0.5 * off * off) : level;
      });
    default:
      return;
  }
}

// By joint states, say. None in a scene without motion.
std::optional<SpecificForceReading> WholePictures::MeasuredSpecificForce(const SkinTruth& truth) const {
  if (!whole_.scene.motion) return std::nullopt;
  const LinkFault& fault = whole_.fault;
  if (!fault.is_attitude_known) {
    MeasuredLoads unknown;
    unknown.ForgetAttitude();
    return SpecificForceReading{.mps2 = unknown.specific_force_mps2,
                                .covariance = unknown.specific_force_covariance,
                                .origin = AttitudeOrigin::kNone};
  }
  constexpr double kSigmaMps2 = 0.2;
  // An error of one standard deviation that stays: joints' zeros are off.
  const Vec3 error_mps2 = kSigmaMps2 * Vec3(1, -1, 1).normalized();
  const double off_rad = fault.mount_off_rad.norm();
  Vec3 mps2 = truth.specific_force_mps2 + error_mps2;
  if (off_rad > 0) mps2 = Eigen::AngleAxisd(off_rad, fault.mount_off_rad / off_rad) * mps2;
  return SpecificForceReading{.mps2 = mps2,
                              .covariance = kSigmaMps2 * kSigmaMps2 * Mat3::Identity(),
                              .origin = AttitudeOrigin::kJointStates};
}

// Whether the image before is shown again.
bool WholePictures::Repeats(int frame) const {
  switch (whole_.fault.pictures) {
    case PictureFault::kFrozen:
    case PictureFault::kReencoded:
      return true;
    case PictureFault::kHalfRate:
      return frame % 2 != 0;
    default:
      return false;
  }
}

// An encoder that keeps to a rate changes its quality from image to image.
int WholePictures::QualityOf(int frame) const {
  if (whole_.fault.pictures == PictureFault::kJpeg) return static_cast<int>(whole_.fault.amount);
  constexpr int kLeast = 80, kDifferent = 10;
  return kLeast + frame % kDifferent;
}

void WholePictures::Tear(int frame, CameraId id) {
  const cv::Mat& gray = gray_[Index(id)];
  const cv::Mat upper = gray.rowRange(0, gray.rows / 2).clone();
  Draw(renderer_, frame, then_, id);
  upper.copyTo(gray.rowRange(0, gray.rows / 2));
}

void WholePictures::LoseMarkers(double time_s, SkinTruth& truth) const {
  const LinkFault& fault = whole_.fault;
  truth.marker_is_lost.assign(fault.lost_markers.empty() ? 0 : truth.marker_mm.size(), false);
  for (size_t i = 0; i < fault.lost_markers.size(); ++i) {
    const double part = static_cast<double>(i) / static_cast<double>(fault.lost_markers.size());
    if (time_s >= fault.lost_s + part * fault.grows_s)
      truth.marker_is_lost[static_cast<size_t>(fault.lost_markers[i])] = true;
  }
}

void WholePictures::Take(int frame, StereoFrame& pictures, SkinTruth& truth) {
  const double time_s = frame / whole_.scene.frame_rate_hz;
  const LinkFault& fault = whole_.fault;
  const bool is_on = fault.pictures != PictureFault::kNone && time_s >= fault.begin_s;
  skin_.Evaluate(time_s, truth);
  aging_.Move(truth);
  LoseMarkers(time_s, truth);
  const bool is_of_then = fault.pictures == PictureFault::kLate || fault.pictures == PictureFault::kTorn;
  if (is_on && is_of_then)
    skin_.Evaluate(std::max(0.0, time_s - fault.amount), then_);
  else if (is_on && other_)
    other_->Evaluate(time_s, then_);
  for (const CameraId id : kBothCameras) {
    const auto i = Index(id);
    const bool is_spoiled = is_on && fault.cameras[i];
    if (is_spoiled && frame > 0 && Repeats(frame)) continue;
    if (is_on && fault.pictures == PictureFault::kTwice && id == CameraId::kBottom) {
      gray_[0].copyTo(gray_[i]);
      continue;
    }
    const bool has_then = fault.pictures == PictureFault::kLate || other_;
    Draw(is_spoiled ? moved_ : renderer_, frame, is_spoiled && has_then ? then_ : truth, id);
    if (is_spoiled && fault.pictures == PictureFault::kTorn) Tear(frame, id);
    if (is_spoiled) Spoil(frame, id, gray_[i]);
  }
  const bool is_swapped = is_on && fault.pictures == PictureFault::kSwapped;
  for (size_t i = 0; i < kCameraCount; ++i) {
    const cv::Mat& gray = gray_[is_swapped ? 1 - i : i];
    RawImage& image = pictures.images[i];
    if (is_on && fault.cameras[i] && IsCompressed(fault.pictures)) {
      image.format = PixelFormat::kMjpeg;
      image.width_px = gray.cols;
      image.height_px = gray.rows;
      image.valid = encoder_.Encode(gray, QualityOf(frame), image.bytes).ok();
    } else {
      PackYuyv(gray, {}, image);
    }
  }
  pictures.sequence = static_cast<uint64_t>(frame);
  pictures.times.exposure_monotonic_ns =
      static_cast<int64_t>((frame + 1) / whole_.scene.frame_rate_hz * 1e9);  // 0 would be none
  pictures.specific_force = MeasuredSpecificForce(truth);
  pictures.pressure_mpa.reset();
  pictures.pressure.origin = PressureOrigin::kNone;
  if (!fault.is_pressure_reported) return;
  pictures.pressure.origin = PressureOrigin::kSerial;
  pictures.pressure_mpa = ExactInPascals(truth.pressure_mpa + fault.pressure_error_mpa);
}

}  // namespace taclink
