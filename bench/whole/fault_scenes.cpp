#include <cmath>
#include <cstdio>
#include <string>
#include <utility>

#include "bench/whole/scene_maker.h"

namespace taclink {

void SceneMaker::Pressures() {
  using enum ReasonId;
  for (const double off_pa : {-100.0, 100.0}) {
    WholeScene& whole =
        Touched(off_pa < 0 ? "pressure reported 100 Pa too low" : "pressure reported 100 Pa too high", 1);
    whole.fault.pressure_error_mpa = 1e-6 * off_pa;
  }
  WholeScene& wrong = Touched("pressure reported 400 Pa too high", 1);
  wrong.fault.pressure_error_mpa = 4e-4;
  wrong.named_by = {kPressureMismatch};
  for (const double kpa : {0.1, 0.5, 1.0}) {
    char kind[40];
    std::snprintf(kind, sizeof kind, "no pressure source, %.1f kPa", kpa);
    WholeScene& whole = Touched(kind, kpa);
    whole.fault.is_pressure_reported = false;
    whole.named_by = {kPressureUnknown};
  }
  for (const double kpa : {0.1, 0.5, 1.0}) {
    char kind[60];
    std::snprintf(kind, sizeof kind, "no pressure source, inflated to %.1f kPa before", kpa);
    WholeScene& whole = Touched(kind, kpa);
    whole.scene.pressure = {{0, kpa}};
    whole.fault.is_pressure_reported = false;
    whole.named_by = {kPressureUnknown};
  }
  for (const double factor : {1.1, 0.9}) {
    WholeScene& stiff =
        Touched(factor > 1 ? "E configured 10 % too high, 0.5 kPa" : "E configured 10 % too low, 1 kPa",
                factor > 1 ? kUsualKpa : 1);
    stiff.fault.modulus_factor = factor;
    stiff.named_by = {kStiffnessMismatch};
  }
}

// From the beginning, which calibration may take up, and within the run.
void SceneMaker::Trouble(const std::string& kind, PictureFault fault, double amount,
                         std::array<bool, kCameraCount> cameras, std::vector<ReasonId> named_by,
                         bool from_start) {
  WholeScene& onset = Touched(kind, kUsualKpa);
  onset.fault.pictures = fault;
  onset.fault.amount = amount;
  onset.fault.cameras = cameras;
  onset.named_by = named_by;
  onset.fault.begin_s = kFaultS;
  if (!from_start) return;
  WholeScene always = onset;
  always.kind += ", always";
  always.scene.name += ", always";
  always.fault.begin_s = -1;
  always.named_by.clear();  // what there was when the cameras were calibrated may have been taken up
  scenes_.push_back(std::move(always));
}

void SceneMaker::Cameras() {
  using enum ReasonId;
  constexpr std::array<bool, kCameraCount> kTop = {true, false}, kBottom = {false, true},
                                           kBoth = {true, true};
  const std::vector<ReasonId> moved = {kCamerasMoved, kCamerasDisagree, kLabels, kResidual};
  Trouble("top frozen", PictureFault::kFrozen, 0, kTop, {ReasonId::kFrozen}, false);
  Trouble("bottom frozen", PictureFault::kFrozen, 0, kBottom, {ReasonId::kFrozen}, false);
  Trouble("both frozen", PictureFault::kFrozen, 0, kBoth, {ReasonId::kFrozen}, false);
  Trouble("top 0.2 s late", PictureFault::kLate, 0.2, kTop, {kLate, kCamerasDisagree, kResidual, kLabels});
  Trouble("bottom 0.1 s late", PictureFault::kLate, 0.1, kBottom,
          {kLate, kCamerasDisagree, kResidual, kLabels});
  Trouble("top 0.5 s late", PictureFault::kLate, 0.5, kTop, {kLate, kCamerasDisagree, kResidual, kLabels});
  // What is shown again is not new, however it is sent.
  Trouble("top frozen, encoded again", PictureFault::kReencoded, 0, kTop, {ReasonId::kFrozen}, false);
  Trouble("both frozen, encoded again", PictureFault::kReencoded, 0, kBoth, {ReasonId::kFrozen}, false);
  Trouble("top at half the rate", PictureFault::kHalfRate, 0, kTop, {kFrameRate}, false);
  Trouble("top torn by 0.1 s", PictureFault::kTorn, 0.1, kTop, {kLate, kCamerasDisagree, kResidual, kLabels},
          false);
  Trouble("both torn by 0.3 s", PictureFault::kTorn, 0.3, kBoth,
          {kLate, kCamerasDisagree, kResidual, kLabels}, false);
  Trouble("one camera for both", PictureFault::kTwice, 0, kBoth, {kCamera});
  Trouble("top mirrored", PictureFault::kMirrored, 0, kTop, {kCamerasMoved});
  LateSlowly();
  Trouble("crossed", PictureFault::kCrossed, 0, kTop, {kCamerasDisagree, kResidual, kLabels});
  Trouble("swapped", PictureFault::kSwapped, 0, kBoth, {kCamerasSwapped});
  Trouble("top rolled by 5 deg", PictureFault::kRolled, 5, kTop, {kCamerasMoved});
  Trouble("top rolled by 90 deg", PictureFault::kRolled, 90, kTop, {kCamerasMoved});
  Trouble("top rolled by 180 deg", PictureFault::kRolled, 180, kTop, {kCamerasMoved});
  // What is taken up.
  Trouble("top shifted by 0.35 px", PictureFault::kShifted, 0.35, kTop, {}, false);
  Trouble("bottom moved by 0.2 mm", PictureFault::kMoved, 0.2, kBottom, {}, false);
  Trouble("bottom turned by 0.08 deg", PictureFault::kTurned, 0.08, kBottom, {}, false);
  // And what is more than that.
  Trouble("top shifted by 1 px", PictureFault::kShifted, 1, kTop, moved);
  Trouble("top shifted by 3 px", PictureFault::kShifted, 3, kTop, {kCamerasMoved});
  Trouble("bottom moved by 0.3 mm", PictureFault::kMoved, 0.3, kBottom, moved);
  Trouble("bottom turned by 0.3 deg", PictureFault::kTurned, 0.3, kBottom, moved);
  Trouble("both moved by 1 mm", PictureFault::kMoved, 1, kBoth, {kCamerasMoved});
  Trouble("top scaled by 2 %", PictureFault::kScaled, 1.02, kTop, moved);
  Trouble("top scaled by 10 %", PictureFault::kScaled, 1.1, kTop, {kCamerasMoved});
  BothCameras();
  WholeScene& other = Touched("another link's calibration", kUsualKpa);
  other.fault.is_calibrated = true;
  other.fault.calibration_off = {.shift_mm = {0.7, -0.5, 0.6}, .turn_rad = {0.01, -0.008, 0.02}};
  other.named_by = moved;
  WholeScene& wrong = Touched("wrong model", kUsualKpa);
  wrong.fault.configured_model = model_.name == "cylinder" ? "barrel" : "cylinder";
  wrong.named_by = {kResidual};
}

// Changes that both cameras undergo alike, so that they agree with each other.
void SceneMaker::BothCameras() {
  using enum ReasonId;
  constexpr std::array<bool, kCameraCount> kBoth = {true, true};
  Trouble("both shifted by 2 px", PictureFault::kShifted, 2, kBoth, {kCamerasMoved}, false);
  Trouble("both vibrate by 1.5 px", PictureFault::kVibrating, 1.5, kBoth, {kCamerasMoved}, false);
  Trouble("both at half the rate", PictureFault::kHalfRate, 0, kBoth, {kFrameRate, ReasonId::kFrozen}, false);
  for (const double kpa : {0.0, kUsualKpa}) {
    WholeScene& grows =
        Touched(kpa == 0 ? "both grow by 1.2 % within 3 s, slack" : "both grow by 1.2 % within 3 s", kpa);
    grows.fault.pictures = PictureFault::kScaled;
    grows.fault.amount = 1.012;
    grows.fault.begin_s = kTouchS;
    grows.fault.grows_s = 3;
    grows.named_by = {kCamerasMoved};
  }
  for (const double share : {0.5, 0.85}) {
    WholeScene& blended = Touched(share < 0.6 ? "both blend by 50 %" : "both blend by 85 %", kUsualKpa);
    blended.fault.pictures = PictureFault::kBlended;
    blended.fault.amount = share;
    blended.named_by = {kTemporalSmoothing};
  }
}

// Where the two pictures differ little from frame to frame, or one of them shows little.
void SceneMaker::LateSlowly() {
  using enum ReasonId;
  for (const bool is_slow : {true, false}) {
    WholeScene& whole =
        Add(is_slow ? "slow press, top 0.5 s late" : "press near the end, top 0.2 s late", kUsualKpa);
    SceneContact& contact = Press(whole, 90, Along(is_slow ? 0.5 : 0.2), 11);
    contact.force_n = 0.45;
    if (is_slow) contact.ramp_s = (kLetGoS - kTouchS) / 2;
    whole.fault.pictures = PictureFault::kLate;
    whole.fault.amount = is_slow ? 0.5 : 0.2;
    whole.fault.cameras = {true, false};
    whole.named_by = {kLate, kCamerasDisagree, kResidual, kLabels};
  }
}

void SceneMaker::Light() {
  using enum ReasonId;
  constexpr std::array<bool, kCameraCount> kTop = {true, false}, kBoth = {true, true};
  const std::vector<ReasonId> dim = {kFewMarkers, kSparseMarkers, kCamera, kLabels};
  Trouble("top hazed", PictureFault::kHazed, 0.6, kTop, {});
  Trouble("top blurred by 3 px", PictureFault::kBlurred, 3, kTop, {});
  Trouble("top half covered", PictureFault::kCovered, 0.5, kTop, {});
  Trouble("both half covered", PictureFault::kCovered, 0.5, kBoth, dim);
  Trouble("hair on the top lens", PictureFault::kHair, 4, kTop, {kLabels});
  Trouble("thick hair on the top lens", PictureFault::kHair, 10, kTop, {kLabels});
  Trouble("big drop on the top lens", PictureFault::kDrop, 80, kTop, {kLabels});
  Trouble("hair on both lenses", PictureFault::kHair, 2, kBoth, {kLabels});
  Trouble("drop on the top lens", PictureFault::kDrop, 40, kTop, {kLabels});
  Trouble("small drop on the top lens", PictureFault::kDrop, 20, kTop, {kLabels});
  Trouble("top lamp out", PictureFault::kDark, 0.03, kTop, {});
  Trouble("both lamps out", PictureFault::kDark, 0.03, kBoth, dim);
  Trouble("noise of 5 levels", PictureFault::kNoisy, 4.6, kBoth, {});
  Trouble("blur of 1.5 px", PictureFault::kBlurred, 1.33, kBoth, {});
  Trouble("one dark side", PictureFault::kDarkSide, 0.25, kBoth, {});
  Trouble("light falls off tenfold", PictureFault::kFalloff, 0.1, kBoth, {});
  Trouble("glow in the middle", PictureFault::kGlow, 40, kBoth, {});
  Trouble("rim reflections", PictureFault::kRim, 0.3, kBoth, {});
  Trouble("JPEG at quality 70", PictureFault::kJpeg, 70, kBoth, {});
  Growing("top hazed within 8 minutes", PictureFault::kHazed, 0.9, kTop);
  Growing("both blurred within 8 minutes", PictureFault::kBlurred, 2.5, kBoth);
  Growing("lamps fade within 8 minutes", PictureFault::kDark, 0.03, kBoth);
  Growing("top covered within 8 minutes", PictureFault::kCovered, 0.5, kTop);
}

WholeScene& SceneMaker::Growing(const std::string& kind, PictureFault fault, double amount,
                                std::array<bool, kCameraCount> cameras) {
  constexpr double kBeforeS = 60, kGrowsS = 480, kTouchedS = 600, kSlowHz = 0.5;
  WholeScene& whole = Add(kind);
  whole.scene.frame_rate_hz = kSlowHz;
  whole.scene.duration_s = kTouchedS + 120;
  whole.scene.pressure = {{20, 0}, {40, kUsualKpa}};
  whole.frames = static_cast<int>(whole.scene.duration_s * kSlowHz);
  SceneContact& contact = Press(whole, 75, Along(0.45), 11, kTouchedS, kTouchedS + 80);
  contact.force_n = 0.3;
  contact.ramp_s = 10;
  whole.fault.pictures = fault;
  whole.fault.amount = amount;
  whole.fault.cameras = cameras;
  whole.fault.begin_s = kBeforeS;
  whole.fault.grows_s = kGrowsS;
  return whole;
}

// Some break off, before the link starts or while it runs, or one sector after the other, where it is
// touched then.
void SceneMaker::Markers() {
  const auto at = [&](int path, int ring) { return model_.MarkerIndex(path, ring); };
  const int rings = model_.markers.rings();
  std::vector<int> strip;
  for (int ring = 0; ring < rings; ++ring)
    for (const int path : {3, 4}) strip.push_back(at(path, ring));
  for (const bool always : {false, true}) {
    const std::string when = always ? ", always" : "";
    const double lost_s = always ? -1 : kFaultS;
    for (auto& [kind, lost] : std::vector<std::pair<std::string, std::vector<int>>>{
             {"one marker gone", {at(5, 4)}},
             {"three markers gone", {at(5, 4), at(5, 5), at(14, 2)}},
             {"a strip of two paths gone", strip}}) {
      WholeScene& whole = Touched(kind + when, kUsualKpa);
      whole.fault.lost_markers = lost;
      whole.fault.lost_s = lost_s;
    }
  }
  WholeScene& sector = Growing("a sector's markers go within 8 minutes", PictureFault::kNone, 0, {});
  const int middle = static_cast<int>(
      std::lround((RadFromDeg(75) - model_.markers.first_path_angle_rad) / model_.markers.path_pitch_rad()));
  for (int ring = 0; ring < rings; ++ring)
    for (int path = middle - 2; path < middle + 2; ++path)
      sector.fault.lost_markers.push_back(at(path, ring));
  sector.fault.lost_s = sector.fault.begin_s;
}

void SceneMaker::Baselines() {
  for (const bool calibrated : {false, true}) {
    for (const double kpa : {0.0, 1.0}) {
      WholeScene& whole = Add(std::string("started while touched") + (kpa > 0 ? ", 1 kPa" : "") +
                              (calibrated ? ", calibrated" : ""));
      whole.scene.pressure = {{0, kpa}};
      Press(whole, 75, Along(0.45), 11, -1, 2.5).force_n = kpa > 0 ? 0.3 : 0.1;
      Press(whole, 200, Along(0.6), 11, kSecondS, kEndS + 1).force_n = kpa > 0 ? 0.3 : 0.1;
      whole.fault.is_calibrated = calibrated;
    }
  }
  for (const double kpa : {0.5, 1.0, 1.5}) {
    char kind[40];
    std::snprintf(kind, sizeof kind, "baseline under %.1f kPa", kpa);
    WholeScene& whole = Touched(kind);
    whole.scene.pressure = {{2, kpa}, {3.5, kpa - 0.15}};
    whole.fault.is_calibrated = true;
  }
  WholeScene& tared = Touched("tared while touched", kUsualKpa);
  tared.fault.tare_s = 2.2;
  Hour("0.06 N for 45 minutes", 0.06, {}, 0);
  Hour("0.3 N for 45 minutes, 0.5 kPa", 0.3, {}, kUsualKpa);
  Aging();
}

// It lets go before the end, and what the skin keeps of it is no force.
void SceneMaker::Hour(const std::string& kind, double force_n, const SkinAging& aging, double kpa) {
  WholeScene& resting = Add(kind, kpa);
  constexpr double kHourS = 3600, kSlowHz = 0.2;
  resting.fault.aging = aging;
  resting.scene.frame_rate_hz = kSlowHz;
  resting.scene.duration_s = kHourS;
  resting.frames = static_cast<int>(kHourS * kSlowHz);
  SceneContact& thing = Press(resting, 90, Along(0.5), 20, 300, 3000);
  thing.force_n = force_n;
  thing.ramp_s = 60;
  resting.fault.follows_drift = true;
}

void SceneMaker::Aging() {
  constexpr SkinAging kSets = {.set_share = 0.05}, kWarmer = {.warmer_k = 10};
  Touched("dents leave 5 %").fault.aging = kSets;
  Touched("dents leave 5 %, 0.5 kPa", kUsualKpa).fault.aging = kSets;
  Hour("0.06 N for 45 minutes, leaves 5 %", 0.06, kSets, 0);
  Touched("10 K warmer").fault.aging = kWarmer;
  Touched("10 K warmer, 0.5 kPa", kUsualKpa).fault.aging = kWarmer;
  WholeScene& unknown = Touched("10 K warmer, no pressure source");
  unknown.fault.aging = kWarmer;
  unknown.fault.is_pressure_reported = false;
  unknown.named_by = {ReasonId::kPressureUnknown};
}

}  // namespace taclink
