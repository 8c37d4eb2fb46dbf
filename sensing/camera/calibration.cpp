#include "sensing/camera/calibration.h"

#include <Eigen/Cholesky>
#include <algorithm>
#include <cmath>
#include <cstdio>
#include <filesystem>
#include <fstream>
#include <vector>

#include "sensing/camera/projection.h"
#include "sensing/camera/triangulation.h"
#include "sensing/model/model_file.h"

namespace taclink {
namespace {

constexpr int kClosedFormRounds = 10;
constexpr int kMaxSteps = 60;
constexpr int kTrimRounds = 3;
constexpr double kSigmaFloorPx = 0.1;  // a detection is not believed to be better than this
constexpr double kMaxSigmaPx = 2;      // worse ones (clipped) do not count
constexpr double kMinOutlierPx = 0.6;
constexpr double kPlaceStiffness = 1e3;  // sigmas per mm beyond the mount's tolerance
constexpr int kFormatVersion = 1;

struct Sample {
  Vec3 p_in_link;
  Vec2 pixel;
  double weight;  // 1 / sigma
};

// Coaxial camera: 0 focal px, 1 distance b mm, 2-3 principal point px, 4 roll rad, 5 k1 in 1e-6/px2,
// 6 k2 in 1e-11/px4. So scaled, all have steps of a like size.
using Parameters = Eigen::Matrix<double, 7, 1>;
constexpr double kK1Unit = 1e-6, kK2Unit = 1e-11;

double PlaceOnAxis(const LinkModel& model, CameraId id) {
  const double z = model.nominal_rig[id].camera_from_link.Inverse().translation.z();
  return id == CameraId::kTop ? -z : z;
}

CameraModel CameraFrom(const LinkModel& model, CameraId id, const Parameters& p) {
  CameraModel camera = model.nominal_rig[id];
  camera.lens = {p[0], Vec2(p[2], p[3]), p[5] * kK1Unit, p[6] * kK2Unit};
  const Mat3 roll(Eigen::AngleAxisd(p[4], Vec3::UnitZ()));
  camera.camera_from_link.rotation = roll * model.nominal_rig[id].camera_from_link.rotation;
  const Vec3 center(0, 0, id == CameraId::kTop ? -p[1] : p[1]);
  camera.camera_from_link.translation = -(camera.camera_from_link.rotation * center);
  return camera;
}

// Depth along the axis beyond the camera's place b, as (4.3) and (4.4) count it.
double AxialZ(CameraId id, const Vec3& p) {
  return id == CameraId::kTop ? p.z() : -p.z();
}

std::vector<Sample> Collect(const LinkModel& model, std::span<const MarkerObservation> rest) {
  std::vector<Sample> samples;
  for (size_t i = 0; i < rest.size(); ++i) {
    if (!rest[i].seen || rest[i].sigma_px() > kMaxSigmaPx) continue;
    const double weight = 1 / std::hypot(rest[i].sigma_px(), kSigmaFloorPx);
    samples.push_back({model.RestMarker(static_cast<int>(i)), rest[i].center_px, weight});
  }
  return samples;
}

// Where the paths' lines meet, and the roll against the nominal orientation: linear least squares of the
// distance across the lines, n . (pixel - center) = r roll, repeated because n turns with the roll.
void FindCenterAndRoll(const LinkModel& model, CameraId id, const std::vector<Sample>& samples,
                       Parameters& p) {
  const Mat3& rotation = model.nominal_rig[id].camera_from_link.rotation;
  for (int round = 0; round < kClosedFormRounds; ++round) {
    Mat3 normal = Mat3::Zero();
    Vec3 right = Vec3::Zero();
    for (const Sample& s : samples) {
      const Vec3 d = rotation * Vec3(s.p_in_link.x(), s.p_in_link.y(), 0);
      const double line = std::atan2(d.y(), d.x()) + p[4];
      const Vec2 across(-std::sin(line), std::cos(line)), at = s.pixel - Vec2(p[2], p[3]);
      const Vec3 row(across.x(), across.y(), at.norm());
      normal += row * row.transpose();
      right += row * across.dot(at);
    }
    const Vec3 step = normal.ldlt().solve(right);
    if (!step.allFinite()) return;
    p.segment<3>(2) += step;
  }
}

// (4.37) for f and b with the lens known, then (4.43) for the lens with f and b known, by turns.
void FindFocalAndLens(CameraId id, const std::vector<Sample>& samples, Parameters& p) {
  for (int round = 0; round < kClosedFormRounds; ++round) {
    Mat2 normal = Mat2::Zero();
    Vec2 right = Vec2::Zero();
    for (const Sample& s : samples) {
      const double r2 = (s.pixel - Vec2(p[2], p[3])).squaredNorm();
      const double r = std::sqrt(r2) / (1 + r2 * (p[5] * kK1Unit + r2 * p[6] * kK2Unit));
      const Vec2 row(s.p_in_link.head<2>().norm(), -r);
      normal += row * row.transpose();
      right += row * r * AxialZ(id, s.p_in_link);
    }
    const Vec2 focal_and_place = normal.ldlt().solve(right);
    if (!focal_and_place.allFinite() || focal_and_place[0] <= 0) return;
    p.head<2>() = focal_and_place;
    normal.setZero();
    right.setZero();
    for (const Sample& s : samples) {
      const double seen2 = (s.pixel - Vec2(p[2], p[3])).squaredNorm(), seen = std::sqrt(seen2);
      const double r = p[0] * s.p_in_link.head<2>().norm() / (p[1] + AxialZ(id, s.p_in_link));
      const Vec2 row(r * seen2 * kK1Unit, r * seen2 * seen2 * kK2Unit);
      normal += row * row.transpose();
      right += row * (seen - r);
    }
    const Vec2 lens = normal.ldlt().solve(right);
    if (!lens.allFinite()) return;
    p.tail<2>() = lens;
  }
}

// What is fitted: samples of one camera, and where its mount can hold it.
struct Problem {
  const LinkModel& model;
  CameraId id;
  double tolerance_mm;  // of the place on the axis
  std::vector<Sample> samples;
};

// Weighted residuals in px sigmas, and how far the place is beyond the mount's tolerance; false: some marker
// can't be projected.
bool Residuals(const Problem& problem, const Parameters& p, Eigen::VectorXd& residuals) {
  if (!(p[0] > 1)) return false;
  const Projector projector(CameraFrom(problem.model, problem.id, p));
  const auto count = static_cast<Eigen::Index>(problem.samples.size());
  residuals.resize(2 * count + 1);
  for (Eigen::Index i = 0; i < count; ++i) {
    const Sample& s = problem.samples[static_cast<size_t>(i)];
    const auto pixel = projector.Project(s.p_in_link);
    if (!pixel) return false;
    residuals.segment<2>(2 * i) = s.weight * (*pixel - s.pixel);
  }
  const double off = std::abs(p[1] - PlaceOnAxis(problem.model, problem.id));
  residuals[2 * count] = kPlaceStiffness * std::max(0.0, off - problem.tolerance_mm);
  return true;
}

// Gauss-Newton with Levenberg's damping; derivatives by central differences. Returns the cost reached.
double Refine(const Problem& problem, Parameters& p) {
  const Parameters steps = (Parameters() << 1e-3, 1e-3, 1e-3, 1e-3, 1e-5, 1e-4, 1e-4).finished();
  Eigen::VectorXd now, plus, minus;
  if (!Residuals(problem, p, now)) return std::numeric_limits<double>::infinity();
  double damping = 1e-4;
  Eigen::MatrixXd jacobian(now.size(), p.size());
  for (int step = 0; step < kMaxSteps && damping < 1e8; ++step) {
    for (Eigen::Index k = 0; k < p.size(); ++k) {
      const Parameters h = steps[k] * Parameters::Unit(k);
      if (!Residuals(problem, p + h, plus) || !Residuals(problem, p - h, minus)) return now.squaredNorm();
      jacobian.col(k) = (plus - minus) / (2 * steps[k]);
    }
    const Eigen::Matrix<double, 7, 7> normal = jacobian.transpose() * jacobian;
    const Parameters gradient = jacobian.transpose() * now;
    bool better = false;
    while (!better && damping < 1e8) {
      Eigen::Matrix<double, 7, 7> damped = normal;
      damped.diagonal() += damping * normal.diagonal();
      const Parameters candidate = p - damped.ldlt().solve(gradient);
      better = candidate.allFinite() && Residuals(problem, candidate, plus) &&
               plus.squaredNorm() < now.squaredNorm();
      damping = better ? damping / 10 : damping * 10;
      if (!better) continue;
      const double gain = 1 - plus.squaredNorm() / now.squaredNorm();
      p = candidate;
      now = plus;
      if (gain < 1e-10) return now.squaredNorm();
    }
  }
  return now.squaredNorm();
}

// The better of two starts: the closed form, and the nominal lens.
Parameters Fit(const Problem& problem) {
  const auto& [model, id, tolerance_mm, samples] = problem;
  const LensModel& lens = model.nominal_rig[id].lens;
  Parameters nominal;
  nominal << lens.focal_px, PlaceOnAxis(model, id), lens.principal_point_px, 0, lens.k1_per_px2 / kK1Unit,
      lens.k2_per_px4 / kK2Unit;
  FindCenterAndRoll(model, id, samples, nominal);
  Parameters closed = nominal;
  FindFocalAndLens(id, samples, closed);
  closed[1] = std::clamp(closed[1], nominal[1] - tolerance_mm, nominal[1] + tolerance_mm);
  const double nominal_cost = Refine(problem, nominal);
  const double closed_cost = Refine(problem, closed);
  return closed_cost <= nominal_cost ? closed : nominal;
}

std::vector<double> ErrorsPx(const CameraModel& camera, const std::vector<Sample>& samples) {
  const Projector projector(camera);
  std::vector<double> errors;
  for (const Sample& s : samples) {
    const auto pixel = projector.Project(s.p_in_link);
    errors.push_back(pixel ? (*pixel - s.pixel).norm() : std::numeric_limits<double>::infinity());
  }
  return errors;
}

double Median(std::vector<double> values) {
  const auto middle = values.begin() + static_cast<long>(values.size() / 2);
  std::nth_element(values.begin(), middle, values.end());
  return *middle;
}

Error Refusal(const std::string& what) {
  return {ErrorCode::kInvalidArgument, "calibration refused: " + what};
}

std::string Rounded(double value) {
  char text[32];
  std::snprintf(text, sizeof text, "%.2f", value);
  return text;
}

}  // namespace

Result<CameraCalibration> CalibrateCamera(const LinkModel& model, CameraId id,
                                          std::span<const MarkerObservation> rest,
                                          const CalibrationOptions& options) {
  const std::vector<Sample> all = Collect(model, rest);
  const std::string camera_name = std::string("the ") + Name(id) + " camera ";
  if (static_cast<double>(all.size()) < std::max(8.0, options.min_seen * model.markers.count()))
    return Refusal(camera_name + "sees only " + std::to_string(all.size()) + " of " +
                   std::to_string(model.markers.count()) + " markers well");
  Problem problem{model, id, options.place_tolerance_mm, all};
  std::vector<Sample>& used = problem.samples;
  Parameters parameters;
  for (int round = 0; round < kTrimRounds; ++round) {
    parameters = Fit(problem);
    const auto errors = ErrorsPx(CameraFrom(model, id, parameters), all);
    const double limit = std::max(kMinOutlierPx, 4 * Median(errors));
    used.clear();
    for (size_t i = 0; i < all.size(); ++i) {
      if (errors[i] <= limit) used.push_back(all[i]);
    }
  }
  CameraCalibration result;
  result.camera = CameraFrom(model, id, parameters);
  result.markers_used = static_cast<int>(used.size());
  result.outliers = static_cast<int>(all.size() - used.size());
  double squares = 0;
  for (const double e : ErrorsPx(result.camera, used)) squares += e * e;
  result.rms_px = std::sqrt(squares / (2.0 * static_cast<double>(used.size())));
  if (result.outliers > options.max_outliers * static_cast<double>(all.size()))
    return Refusal(std::to_string(result.outliers) + " of the " + std::to_string(all.size()) +
                   " markers that " + camera_name + "sees do not fit the model");
  if (!(result.rms_px <= options.max_rms_px))
    return Refusal(camera_name + "fits to " + Rounded(result.rms_px) + " px only, " +
                   Rounded(options.max_rms_px) + " px is the limit");
  return result;
}

Result<CalibrationSummary> CalibrateFromRest(const LinkModel& model, const LabelledMarkers& rest,
                                             const CalibrationOptions& options) {
  CalibrationSummary summary;
  double squares = 0;
  int used = 0;
  for (const CameraId id : kBothCameras) {
    auto one = CalibrateCamera(model, id, rest.cameras[Index(id)], options);
    if (!one) return one.error();
    summary.rig[id] = one->camera;
    squares += one->rms_px * one->rms_px * one->markers_used;
    used += one->markers_used;
  }
  summary.rms_px = std::sqrt(squares / used);
  const Projector top(summary.rig[CameraId::kTop]), bottom(summary.rig[CameraId::kBottom]);
  double r = 0, z = 0, all = 0;
  for (size_t i = 0; i < rest.cameras[0].size(); ++i) {
    const MarkerObservation &a = rest.cameras[0][i], &b = rest.cameras[1][i];
    if (!a.seen || !b.seen || std::max(a.sigma_px(), b.sigma_px()) > kMaxSigmaPx) continue;
    const auto ray_a = top.Ray(a.center_px), ray_b = bottom.Ray(b.center_px);
    if (!ray_a || !ray_b) continue;
    const auto meeting = MeetRays({top.center_in_link(), *ray_a}, {bottom.center_in_link(), *ray_b});
    if (!meeting) continue;
    const Vec3 truth = model.RestMarker(static_cast<int>(i)), off = meeting->point_mm - truth;
    r += std::pow(meeting->point_mm.head<2>().norm() - truth.head<2>().norm(), 2);
    z += off.z() * off.z();
    all += off.squaredNorm();
    ++summary.markers_used;
  }
  if (summary.markers_used < 8) return Refusal("fewer than 8 markers are seen by both cameras");
  summary.rmse_r_mm = std::sqrt(r / summary.markers_used);
  summary.rmse_z_mm = std::sqrt(z / summary.markers_used);
  summary.rmse_3d_mm = std::sqrt(all / summary.markers_used);
  return summary;
}

Result<StereoRig> LoadCalibration(const std::string& path, const LinkModel& model) {
  auto file = YamlFile::Load(path);
  if (!file) return file.error();
  YamlMap& root = file->root();
  root.Integer("taclink_calibration", {.min = kFormatVersion, .max = kFormatVersion});
  if (const std::string name = root.Text("model"); !name.empty() && name != model.name) {
    root.Fail("model", "is '" + name + "', but the link's model is '" + model.name + "'");
  }
  root.Integer("markers_used", 0);
  root.Number("rms_px", 0.0);
  StereoRig rig;
  YamlMap cameras = root.Map("cameras");
  for (const CameraId id : kBothCameras) rig[id] = ReadCamera(cameras.Map(Name(id)), id);
  cameras.Done();
  root.Done();
  if (auto good = file->Finish(); !good) return good.error();
  return rig;
}

Result<void> SaveCalibration(const std::string& path, const std::string& model_name,
                             const CalibrationSummary& summary) {
  const std::string part = path + ".part";
  std::ofstream out(part, std::ios::trunc);
  out << "taclink_calibration: " << kFormatVersion << "\nmodel: " << model_name
      << "\nmarkers_used: " << summary.markers_used << "\nrms_px: " << summary.rms_px << "\ncameras:\n";
  for (const CameraId id : kBothCameras) {
    out << "  " << Name(id) << ":\n" << CameraText(summary.rig[id], id, "    ");
  }
  out.close();
  std::error_code error;
  if (out) std::filesystem::rename(part, path, error);
  if (!out || error)
    return Error{ErrorCode::kUnavailable, "cannot write the calibration file '" + path + "'"};
  return {};
}

}  // namespace taclink
