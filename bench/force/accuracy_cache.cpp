#include <filesystem>
#include <fstream>
#include <iomanip>
#include <limits>
#include <sstream>

#include "bench/force/accuracy_truth.h"

namespace taclink {
namespace {

constexpr int kDigits = std::numeric_limits<double>::max_digits10;

void Put(std::ostream& out, const Vec3& v) {
  out << v.x() << ' ' << v.y() << ' ' << v.z() << '\n';
}

void Put(std::ostream& out, const std::vector<Vec3>& points) {
  out << points.size() << '\n';
  for (const Vec3& p : points) Put(out, p);
}

void Put(std::ostream& out, const TrueStage& stage) {
  out << stage.stage.depth_mm << ' ' << stage.stage.drag_mm << '\n';
  Put(out, stage.displacements_mm);
  out << stage.contacts.size() << '\n';
  for (const BodyContact& contact : stage.contacts) {
    Put(out, contact.force_n);
    Put(out, contact.center_mm);
    Put(out, contact.touched_mm);
  }
  Put(out, stage.baseline_mm);
}

// Lists are never longer than this: a broken file must not ask for all memory.
constexpr size_t kMost = 1000000;

bool Get(std::istream& in, Vec3& v) {
  return static_cast<bool>(in >> v.x() >> v.y() >> v.z());
}

template <typename T, typename Read>
bool GetList(std::istream& in, std::vector<T>& list, Read read) {
  size_t count = 0;
  if (!(in >> count) || count > kMost) return false;
  list.clear();
  for (size_t i = 0; i < count; ++i) {
    T item{};
    if (!read(item)) return false;
    list.push_back(std::move(item));
  }
  return true;
}

bool Get(std::istream& in, std::vector<Vec3>& points) {
  return GetList(in, points, [&](Vec3& p) { return Get(in, p); });
}

bool Get(std::istream& in, TrueStage& stage) {
  if (!(in >> stage.stage.depth_mm >> stage.stage.drag_mm)) return false;
  return Get(in, stage.displacements_mm) &&
         GetList(in, stage.contacts,
                 [&](BodyContact& contact) {
                   return Get(in, contact.force_n) && Get(in, contact.center_mm) &&
                          Get(in, contact.touched_mm);
                 }) &&
         Get(in, stage.baseline_mm);
}

}  // namespace

std::string TruthKey(const LinkModel& model, const PressPath& path, int refinement) {
  std::ostringstream key;
  key << std::setprecision(kDigits) << "taclink truth 2 " << path.name << " refinement " << refinement
      << " length " << model.length_mm << " thickness " << model.thickness_mm << " middle "
      << model.PointAtDepth(0, model.length_mm / 2, 0).x() << " end " << model.PointAtDepth(0, 0, 0).x()
      << " tube " << model.tube_outer_radius_mm << " E " << model.material.youngs_modulus_mpa << " nu "
      << model.material.poisson_ratio << " law " << static_cast<int>(model.material.law) << " markers "
      << model.markers.paths << " x " << model.markers.rings() << " at " << model.markers.rings_z_mm.front()
      << " to " << model.markers.rings_z_mm.back() << " depth " << model.markers.center_depth_mm;
  for (const PressBody& body : path.bodies) {
    const Vec3 at = OriginOf(body.touching);
    key << " body " << body.touching.index() << ' ' << at.x() << ' ' << at.y() << ' ' << at.z();
  }
  for (const PressStage& stage : path.stages) key << ' ' << stage.depth_mm << '/' << stage.drag_mm;
  if (!path.attitude.empty()) {
    const Vec3 &now = path.specific_force_mps2, &baseline = path.baseline_specific_force_mps2;
    key << " density " << model.density_kg_m3 << " specific force " << now.x() << ' ' << now.y() << ' '
        << now.z() << " from " << baseline.x() << ' ' << baseline.y() << ' ' << baseline.z();
  }
  return key.str();
}

std::string TruthText(const PathTruth& truth, const std::string& key) {
  std::ostringstream out;
  out << std::setprecision(kDigits) << key << '\n' << truth.failure << '\n' << truth.cpu_s << '\n';
  Put(out, truth.inflated);
  out << truth.stages.size() << '\n';
  for (const TrueStage& stage : truth.stages) Put(out, stage);
  out << "end\n";
  return out.str();
}

bool ReadTruth(const std::string& text, const std::string& key, PathTruth& truth) {
  std::istringstream in(text);
  std::string line, end;
  if (!std::getline(in, line) || line != key) return false;
  PathTruth read;
  read.path = truth.path;
  if (!std::getline(in, read.failure) || !(in >> read.cpu_s) || !Get(in, read.inflated)) return false;
  if (!GetList(in, read.stages, [&](TrueStage& stage) { return Get(in, stage); })) return false;
  if (!(in >> end) || end != "end") return false;
  truth = std::move(read);
  return true;
}

Result<PathTruth> CachedPath(const LinkModel& model, const PressPath& path, int refinement,
                             const std::string& folder) {
  if (folder.empty()) return SolvePath(model, path, refinement);
  const auto file = std::filesystem::path(folder) / (path.name + "-" + std::to_string(refinement) + ".truth");
  const std::string key = TruthKey(model, path, refinement);
  PathTruth truth;
  truth.path = path;
  if (const std::ifstream in(file); in) {
    std::ostringstream text;
    text << in.rdbuf();
    if (ReadTruth(text.str(), key, truth)) return truth;
  }
  truth = SolvePath(model, path, refinement);
  std::error_code failed;
  std::filesystem::create_directories(folder, failed);
  std::ofstream out(file, std::ios::trunc);
  out << TruthText(truth, key);
  out.close();
  if (!out)
    return Error{ErrorCode::kUnavailable,
                 file.string() + ": cannot be written; check the folder and the disk"};
  return truth;
}

}  // namespace taclink
