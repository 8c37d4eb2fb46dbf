#pragma once

#include <array>
#include <cmath>
#include <string>
#include <vector>

#include "bench/whole/whole_scenes.h"

namespace taclink {

/// Makes the scenes of the whole benchmark for one link model. See WholeScenes.
class SceneMaker {
 public:
  explicit SceneMaker(const LinkModel& model) : model_(model) {}

  std::vector<WholeScene> Make();

 private:
  static constexpr double kRateHz = 30;
  static constexpr double kInflateS = 0.5, kInflatedS = 1.2, kTouchS = 1.4, kSecondS = 3, kFaultS = 2.4,
                          kLetGoS = 4.2, kEndS = 5;
  static constexpr double kRampS = 0.5;
  static constexpr double kUsualKpa = 0.5;         // faults are tested on an inflated link, too
  static constexpr int kWholeTruthRefinement = 3;  // finer than any link's mesh

  WholeScene& Add(const std::string& kind, double kpa = 0);
  /// A disc that presses at an angle and a distance along the link.
  static SceneContact& Press(WholeScene& whole, double angle_deg, double z_mm, double diameter_mm,
                             double begin_s = kTouchS, double end_s = kLetGoS);
  double Along(double share) const { return share * model_.length_mm; }
  double Ring(int ring) const {
    return model_.markers.rings_z_mm[static_cast<size_t>(ring < 0 ? model_.markers.rings() + ring : ring)];
  }
  /// One disc that stays, and another that comes later: what is wrong with images shows when the skin moves.
  WholeScene& Touched(const std::string& kind, double kpa = 0);

  void Undisturbed();
  void Neighbors(double kpa);
  void Bar();
  void Around(const std::string& kind, int discs, double diameter_mm, double depth_mm, double kpa);
  void Hand(double kpa);
  void Slide(double kpa);

  void DemoScenes();
  void Swinging();
  WholeScene& Swung(const std::string& kind, double kpa = 0);
  WholeScene& Rolled(const std::string& kind, double kpa = 0);
  void MountedOff(double kpa);

  void Pressures();
  void Cameras();
  void LateSlowly();
  void BothCameras();
  void Light();
  void Markers();
  void Baselines();
  void Aging();
  void Hour(const std::string& kind, double force_n, const SkinAging& aging, double kpa);
  /// A fault of the images, from the beginning, which calibration may take up, and within the run.
  void Trouble(const std::string& kind, PictureFault fault, double amount,
               std::array<bool, kCameraCount> cameras, std::vector<ReasonId> named_by,
               bool from_start = true);
  /// A fault that grows over ten minutes, on a link that is touched after it.
  WholeScene& Growing(const std::string& kind, PictureFault fault, double amount,
                      std::array<bool, kCameraCount> cameras);

  const LinkModel& model_;
  std::vector<WholeScene> scenes_;
};

}  // namespace taclink
