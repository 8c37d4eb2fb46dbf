#include "sensing/model/model_file.h"

#include <algorithm>
#include <cmath>
#include <fstream>
#include <span>
#include <sstream>

#include "sensing/core/embedded_file.h"

namespace taclink {

std::span<const EmbeddedFile> EmbeddedModels();

namespace {

constexpr int kFormatVersion = 2;  // since 2: skin.material.evidence
constexpr size_t kMaxMarkers = 1024;
// Thickness over radius: a shell is neither a foil nor a block.
constexpr double kMinThicknessRatio = 1e-4, kMaxThicknessRatio = 0.25;

// Camera frame: x right, y down, z forward. The bottom camera is the top one turned half round about Y.
Mat3 DesignedRotation(CameraId id) {
  return id == CameraId::kTop ? Mat3::Identity() : Mat3(Eigen::AngleAxisd(kPi, Vec3::UnitY()));
}

RadiusProfile ReadProfile(YamlMap map, double length_mm) {
  RadiusProfile profile = RadiusProfile::Constant(1);
  const size_t shape = map.Choice("shape", {"cylinder", "arc", "spline"});
  if (map.Failed("shape")) return profile;  // the other keys depend on it
  switch (shape) {
    case 1: {
      const double end = map.Number("end_radius_mm", kPositive);
      const double middle = map.Number("middle_radius_mm", kPositive);
      if (length_mm > 0 && std::abs(middle - end) >= length_mm / 2)
        map.Fail("middle_radius_mm", "bulges more than half a circle", {"end_radius_mm"});
      profile = RadiusProfile::Arc(length_mm, end, middle);
      break;
    }
    case 2: {
      const auto z = map.Numbers("z_mm");
      const auto r = map.Numbers("radius_mm", z.size(), kPositive);
      bool rising = z.size() >= 2 && z.front() <= 0 && z.back() >= length_mm;
      for (size_t i = 1; i < z.size(); ++i) rising = rising && z[i] > z[i - 1];
      if (!rising) {
        map.Fail("z_mm", "must rise and reach from 0 to the skin's length");
        break;
      }
      std::vector<std::pair<double, double>> points;
      for (size_t i = 0; i < z.size(); ++i) points.emplace_back(z[i], r[i]);
      profile = RadiusProfile::Spline(points);
      break;
    }
    default:
      profile = RadiusProfile::Constant(map.Number("radius_mm", kPositive));
  }
  map.Done();
  return profile;
}

// skin.material.relaxation: {shares: [...], times_s: [...], evidence: {standard_deviations: [...], from:
// ...}}
Relaxation ReadRelaxation(YamlMap map) {
  constexpr double kMostShare = 0.9;
  Relaxation relaxation;
  const auto shares = map.Numbers("shares", 0, kPositive);
  const auto times_s = map.Numbers("times_s", shares.size(), {.min = 1e-3, .max = 1e7});
  double sum = 0, last_s = 0;
  for (size_t i = 0; i < times_s.size(); ++i) {
    if (times_s[i] <= last_s) map.Fail("times_s", "must rise");
    last_s = times_s[i];
    sum += shares[i];
    relaxation.terms.push_back({shares[i], times_s[i]});
  }
  if (shares.empty()) map.Fail("shares", "needs at least one share");
  if (sum > kMostShare) map.Fail("shares", "must not sum to more than 0.9 of the modulus");
  if (map.Has("evidence")) {
    YamlMap evidence = map.Map("evidence");
    relaxation.share_sigmas = evidence.Numbers("standard_deviations", shares.size(), kPositive);
    relaxation.source = evidence.Text("from");
    evidence.Done();
  }
  map.Done();
  return relaxation;
}

void ReadMaterial(YamlMap map, int version, LinkModel& model) {
  Material& material = model.material;
  material.youngs_modulus_mpa = map.Number("youngs_modulus_mpa", {.min = 1e-4, .max = 1e5});
  material.poisson_ratio = map.Number("poisson_ratio", {.min = 0, .max = 0.5});
  constexpr auto kSvk = MaterialLaw::kSaintVenantKirchhoff, kRubber = MaterialLaw::kNeoHookean;
  material.law = map.Choice("law", {Name(kSvk), Name(kRubber)}, 0) == 0 ? kSvk : kRubber;
  if (material.law == kRubber && material.poisson_ratio != 0.5) {
    map.Fail("poisson_ratio", "must be 0.5: the neo_hookean law is incompressible");
  }
  if (version >= 2 && map.Has("evidence")) {
    YamlMap evidence = map.Map("evidence");
    model.material_evidence = {evidence.Number("standard_deviation_mpa", kPositive), evidence.Text("from")};
    evidence.Done();
  }
  if (version >= 2 && map.Has("relaxation")) model.relaxation = ReadRelaxation(map.Map("relaxation"));
  map.Done();
}

void ReadSkin(YamlMap map, int version, LinkModel& model) {
  model.length_mm = map.Number("length_mm", kPositive);
  model.thickness_mm = map.Number("thickness_mm", kPositive);
  model.density_kg_m3 = map.Number("density_kg_m3", 0.0, {.min = 0, .max = 2e4});
  const size_t surface = map.Choice("surface", {"outer", "middle", "inner"}, 0);
  model.profile_depth_mm = model.thickness_mm * 0.5 * static_cast<double>(surface);
  model.profile = ReadProfile(map.Map("profile"), model.length_mm);
  ReadMaterial(map.Map("material"), version, model);
  map.Done();
}

void ReadMarkers(YamlMap map, LinkModel& model) {
  MarkerGrid& grid = model.markers;
  grid.paths = map.Integer("paths", {.min = 4, .max = 256});
  grid.first_path_angle_rad = RadFromDeg(map.Number("first_path_angle_deg", 0.0, {.min = -360, .max = 360}));
  if (map.Has("rings_z_mm")) {
    grid.rings_z_mm = map.Numbers("rings_z_mm");
  } else {
    YamlMap rings = map.Map("rings");
    const double first = rings.Number("first_z_mm", kPositive);
    const double pitch = rings.Number("pitch_mm", kPositive);
    const int count = rings.Integer("count", {.min = 2, .max = 256});
    for (int j = 0; j < count; ++j) grid.rings_z_mm.push_back(first + j * pitch);
    rings.Done();
  }
  double last = 0;
  for (const double z : grid.rings_z_mm) {
    if (z <= last || (model.length_mm > 0 && z >= model.length_mm))
      map.Fail("rings_z_mm", "must rise and lie between the clamped ends", {"rings"});
    last = z;
  }
  if (grid.rings_z_mm.size() < 2) map.Fail("rings_z_mm", "needs at least 2 rings", {"rings"});
  if (grid.rings_z_mm.size() * static_cast<size_t>(grid.paths) > kMaxMarkers) {
    map.Fail("paths", "times the number of rings must be at most " + std::to_string(kMaxMarkers),
             {"rings", "rings_z_mm"});
  }
  grid.diameter_mm = map.Number("diameter_mm", kPositive);
  grid.center_depth_mm =
      map.Number("center_depth_mm", model.thickness_mm + 2 * grid.diameter_mm / (3 * kPi), kNotNegative);
  map.Done();
}

void CheckGeometry(YamlMap& root, const LinkModel& model) {
  const double innermost = std::max(model.thickness_mm, model.markers.center_depth_mm);
  for (int i = 0; i <= 64; ++i) {
    const double z = model.length_mm * i / 64;
    const double ratio = model.thickness_mm / model.PointAtDepth(0, z, model.thickness_mm / 2).x();
    if (!(ratio >= kMinThicknessRatio && ratio <= kMaxThicknessRatio)) {
      root.Fail("skin", "is no shell at z = " + std::to_string(z) + " mm: thickness over radius is " +
                            std::to_string(ratio) + ", not between 0.0001 and 0.25");
      return;
    }
    if (!(model.PointAtDepth(0, z, innermost).x() > model.tube_outer_radius_mm)) {
      root.Fail("skin", "lies inside the tube at z = " + std::to_string(z) +
                            " mm; check profile, thickness and tube");
      return;
    }
  }
}

Result<LinkModel> ReadLinkModel(YamlFile file) {
  YamlMap& root = file.root();
  LinkModel model;
  const int version = root.Integer("taclink_model", {.min = 1, .max = kFormatVersion});
  // Another version's keys mean something else.
  if (root.Has("taclink_model") && root.Failed("taclink_model")) return file.Finish().error();
  model.name = root.Text("name");
  model.description = root.Prose("description", "");
  ReadSkin(root.Map("skin"), version, model);
  ReadMarkers(root.Map("markers"), model);
  YamlMap tube = root.Map("tube");
  model.tube_outer_radius_mm = tube.Number("outer_radius_mm", 0.0, kNotNegative);
  tube.Done();
  YamlMap cameras = root.Map("cameras");
  for (const CameraId id : kBothCameras) model.nominal_rig[id] = ReadCamera(cameras.Map(Name(id)), id);
  cameras.Done();
  root.Done();
  if (auto good = file.Finish(); !good) return good.error();
  CheckGeometry(root, model);
  if (auto good = file.Finish(); !good) return good.error();
  return model;
}

}  // namespace

CameraModel ReadCamera(YamlMap map, CameraId id) {
  CameraModel camera;
  const auto size = map.Integers("image_size_px", 2, {.min = 16, .max = 8192});
  camera.width_px = size[0];
  camera.height_px = size[1];
  camera.lens.focal_px = map.Number("focal_px", kPositive);
  const auto center = map.Numbers("principal_point_px", 2);
  camera.lens.principal_point_px = Vec2(center[0], center[1]);
  camera.lens.kind = static_cast<LensKind>(map.Choice("lens", {kLensNames.begin(), kLensNames.end()}, 0));
  if (map.Failed("lens")) map.Abandon();
  if (camera.lens.kind == LensKind::kKannalaBrandt) {
    const auto k = map.Numbers("fisheye_k", 4);
    std::copy(k.begin(), k.end(), camera.lens.fisheye_k.begin());
  } else {
    camera.lens.k1_per_px2 = map.Number("k1_per_px2", 0.0);
    camera.lens.k2_per_px4 = map.Number("k2_per_px4", 0.0);
  }
  const auto p = map.Numbers("position_mm", 3);
  // Rotation vector in the camera's frame, on top of the designed orientation.
  Vec3 r = Vec3::Zero();
  if (map.Has("rotation_deg")) {
    const auto numbers = map.Numbers("rotation_deg", 3, {.min = -180, .max = 180});
    r = Vec3(RadFromDeg(numbers[0]), RadFromDeg(numbers[1]), RadFromDeg(numbers[2]));
  }
  map.Done();
  const Mat3 turn = r.norm() > 0 ? Mat3(Eigen::AngleAxisd(r.norm(), r.normalized())) : Mat3(Mat3::Identity());
  camera.camera_from_link.rotation = turn * DesignedRotation(id);
  camera.camera_from_link.translation = -(camera.camera_from_link.rotation * Vec3(p[0], p[1], p[2]));
  return camera;
}

std::string CameraText(const CameraModel& camera, CameraId id, const std::string& indent) {
  const Vec3 p = camera.camera_from_link.Inverse().translation;
  const Eigen::AngleAxisd turn(Mat3(camera.camera_from_link.rotation * DesignedRotation(id).transpose()));
  const Vec3 r = turn.axis() * DegFromRad(turn.angle());
  std::ostringstream out;
  out.precision(12);
  out << indent << "image_size_px: [" << camera.width_px << ", " << camera.height_px << "]\n"
      << indent << "lens: " << Name(camera.lens.kind) << "\n"
      << indent << "focal_px: " << camera.lens.focal_px << "\n"
      << indent << "principal_point_px: [" << camera.lens.principal_point_px.x() << ", "
      << camera.lens.principal_point_px.y() << "]\n";
  if (camera.lens.kind == LensKind::kKannalaBrandt) {
    const auto& k = camera.lens.fisheye_k;
    out << indent << "fisheye_k: [" << k[0] << ", " << k[1] << ", " << k[2] << ", " << k[3] << "]\n";
  } else {
    out << indent << "k1_per_px2: " << camera.lens.k1_per_px2 << "\n"
        << indent << "k2_per_px4: " << camera.lens.k2_per_px4 << "\n";
  }
  out << indent << "position_mm: [" << p.x() << ", " << p.y() << ", " << p.z() << "]\n"
      << indent << "rotation_deg: [" << r.x() << ", " << r.y() << ", " << r.z() << "]\n";
  return out.str();
}

Result<LinkModel> ParseLinkModel(const std::string& name, std::string_view content) {
  auto file = YamlFile::Parse(name, content);
  if (!file) return file.error();
  return ReadLinkModel(std::move(*file));
}

Result<LinkModel> LoadLinkModel(const std::string& name_or_path) {
  if (const auto text = ShippedModelText(name_or_path); !text.empty())
    return ParseLinkModel(name_or_path, text);
  auto file = YamlFile::Load(name_or_path);
  if (!file && file.error().code == ErrorCode::kNotFound) {
    std::string names;
    for (const auto& name : ShippedModelNames()) names += (names.empty() ? "" : ", ") + name;
    return Error{ErrorCode::kNotFound,
                 "link model '" + name_or_path + "' is neither a file nor a shipped model (" + names + ")"};
  }
  if (!file) return file.error();
  return ReadLinkModel(std::move(*file));
}

std::vector<std::string> ShippedModelNames() {
  std::vector<std::string> names;
  for (const auto& file : EmbeddedModels()) names.emplace_back(file.name.substr(0, file.name.rfind('.')));
  return names;
}

std::string_view ShippedModelText(const std::string& name) {
  for (const auto& file : EmbeddedModels()) {
    if (file.name == name + ".yaml") return file.content;
  }
  return {};
}

}  // namespace taclink
