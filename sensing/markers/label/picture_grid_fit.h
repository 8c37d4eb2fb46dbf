#pragma once

#include <array>
#include <complex>
#include <string>
#include <vector>

#include "sensing/markers/label/picture_grid.h"

namespace taclink {

/// One fit of a PictureGrid; see there.
class GridFitter {
 public:
  GridFitter(const LinkModel& model, CameraId id, const Detections& detections);
  Result<PictureGrid> Run();

 private:
  struct Spot {
    Vec2 pixel;
    int path = 0;
    double off_path = 0, log_radius = 0;
  };
  struct RingPlace {
    size_t ring = 0;
    double off = 0, spacing = 0;  // log radius; spacing to the nearer neighbour
  };

  Error Refusal(const std::string& why) const;
  Error WrongPaths() const;
  double FindCenter(int paths, Vec2& center, double& roll) const;
  std::complex<double> Coherence(int paths, const Vec2& center) const;
  void RefineStar();
  void PlaceSpots();
  Result<void> FindRings();
  bool NominalLogRadii();
  void SumSpots();
  double Score(const std::vector<double>& radii) const;
  double PartOfRingInside(double log_radius) const;
  void CenterRings();
  void Bend();
  Result<void> CheckRings() const;
  void MeasureLens();
  static RingPlace PlaceAmong(const std::vector<double>& radii, double log_radius);

  const LinkModel& model_;
  const CameraModel& camera_;
  const CameraId id_;
  const Detections& detections_;
  PictureGrid grid_;
  std::vector<Spot> spots_;                  // on paths
  std::vector<double> nominal_;              // log radii, from the camera's end
  std::vector<double> sorted_;               // the spots' log radii
  std::vector<std::array<double, 2>> sums_;  // of the first ones of them, and of their squares
};

}  // namespace taclink
