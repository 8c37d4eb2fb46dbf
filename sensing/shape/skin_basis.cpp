#include "sensing/shape/skin_basis.h"

#include <Eigen/Eigenvalues>
#include <algorithm>
#include <array>
#include <cmath>

#include "sensing/mechanics/linear_shell.h"

namespace taclink {
namespace {

constexpr int kInflations = 4;
constexpr std::array<double, SkinBasis::kBellWidths> kBellWidth = {0.9, 1.8};  // of the markers' spacing
constexpr int kAround = 1;  // index of the component that is odd in the angle

struct Mode {
  int harmonic = 0;
  bool partner = false;       // turned by a quarter of its wave
  double peak_mm = 0;         // largest standard deviation of its displacement
  Eigen::VectorXd amplitude;  // 3 rings
};

double CellArea(const LinkModel& model, int ring) {
  const auto& z = model.markers.rings_z_mm;
  const auto i = static_cast<size_t>(ring);
  const double below = ring > 0 ? z[i - 1] : 0, above = i + 1 < z.size() ? z[i + 1] : model.length_mm;
  const double radius = model.PointAtDepth(0, z[i], model.thickness_mm / 2).x();
  return radius * model.markers.path_pitch_rad() * (above - below) / 2;
}

}  // namespace

SkinBasis::SkinBasis(const LinkModel& model, const SkinBasisOptions& options)
    : paths_(model.markers.paths), rings_(model.markers.rings()) {
  for (int m = 0; m < markers(); ++m) {
    const double angle = model.PathAngle(model.PathOf(m));
    Mat3 frame;
    frame << std::cos(angle), -std::sin(angle), 0, std::sin(angle), std::cos(angle), 0, 0, 0, 1;
    frames_.push_back(frame);
  }
  Solve(model, options);
  FindBells(model);
  FindWaves();
  FindInflation(model);
  FindModes(model, options);
}

void SkinBasis::Solve(const LinkModel& model, const SkinBasisOptions& options) {
  const bool coarse = markers() >= options.coarse_from_markers;
  const LinearShell shell(model, coarse ? 1 : options.refinement);
  const ShellMesh& mesh = shell.mesh();
  const double offset = model.thickness_mm / 2 - model.markers.center_depth_mm;
  const auto stack = [&](const ShellDisplacement& u, const ShellMesh& of, auto&& column) {
    for (int m = 0; m < markers(); ++m) {
      column.template segment<3>(3 * m) =
          Frame(m).transpose() * u.AtOffset(of, of.NodeOfMarker(model, m), offset);
    }
  };
  const bool halves = mesh.refinement % 2 == 0;
  const int half = mesh.refinement / 2, per_set = halves ? rings_ + 1 : 0;
  columns_on_paths_ = 3 * rings_ + per_set;
  responses_.resize(3 * markers(), columns_on_paths_ + (halves ? rings_ + per_set : 0));
  const auto add = [&](int node, const Vec3& direction, int ring) {
    const NodalLoad load{node, direction};
    const auto column = static_cast<Eigen::Index>(ring_of_column_.size());
    stack(shell.Solve({&load, 1}), mesh, responses_.col(column));
    ring_of_column_.push_back(std::clamp(ring, 0, rings_ - 1));
  };
  const auto normal = [&](int node) { return mesh.normals[static_cast<size_t>(node)]; };
  for (int ring = 0; ring < rings_; ++ring) {
    const int node = mesh.NodeOfMarker(model, model.MarkerIndex(0, ring));
    const Vec3 around = Frame(0).col(kAround);
    add(node, -normal(node), ring);
    add(node, around, ring);
    add(node, normal(node).cross(around), ring);
  }
  for (int on = 0; halves && on < 2; ++on) {
    for (int row = 0; row <= 2 * rings_; ++row) {
      if (on == 0 && row % 2 == 1) continue;
      const int node = mesh.Node(on * half, half + row * half);
      add(node, -normal(node), (row - 1) / 2);
    }
  }
  per_pressure_.resize(3 * markers());
  const LinearShell fine(model, coarse ? 1 : options.pressure_refinement);
  stack(fine.PerPressure(), fine.mesh(), per_pressure_);
}

Eigen::MatrixXd SkinBasis::Harmonic(int h) const {
  Eigen::MatrixXd result = Eigen::MatrixXd::Zero(3 * rings_, responses_.cols());
  for (Eigen::Index load = 0; load < result.cols(); ++load) {
    const double from = load < columns_on_paths_ ? 0 : 0.5;
    const bool load_odd = load < 3 * rings_ && load % 3 == kAround;
    for (int k = 0; k < paths_; ++k) {
      const double angle = 2 * kPi * h * (k - from) / paths_, c = std::cos(angle), s = std::sin(angle);
      for (Eigen::Index i = 0; i < result.rows(); ++i) {
        const bool odd = i % 3 == kAround;
        const double weight = load_odd == odd ? c : (odd ? s : -s);
        result(i, load) += weight * responses_(3 * ((i / 3) * paths_ + k) + i % 3, load);
      }
    }
  }
  return result;
}

void SkinBasis::FindBells(const LinkModel& model) {
  const auto& z = model.markers.rings_z_mm;
  for (const double factor : kBellWidth) {
    Eigen::MatrixXd along(rings_, rings_), around(rings_, paths_);
    for (int center = 0; center < rings_; ++center) {
      const double radius = model.RestMarker(model.MarkerIndex(0, center)).head<2>().norm();
      const double width = factor * std::sqrt(CellArea(model, center));
      for (int ring = 0; ring < rings_; ++ring) {
        const double d = (z[static_cast<size_t>(ring)] - z[static_cast<size_t>(center)]) / width;
        along(center, ring) = std::exp(-0.5 * d * d);
      }
      for (int path = 0; path < paths_; ++path) {
        const double d = std::min(path, paths_ - path) * model.markers.path_pitch_rad() * radius / width;
        around(center, path) = std::exp(-0.5 * d * d);
      }
    }
    along_.push_back(std::move(along));
    around_.push_back(std::move(around));
  }
}

void SkinBasis::FindWaves() {
  wave_amplitudes_.resize(3 * rings_, kWaves * wave_rings());
  for (int wave = 0; wave < kWaves; ++wave) {
    const Eigen::MatrixXd answers = Harmonic(HarmonicOf(wave));
    for (int ring = 0; ring < wave_rings(); ++ring)
      wave_amplitudes_.col(wave * wave_rings() + ring) = answers.col(InwardColumn(ring));
  }
}

void SkinBasis::FindInflation(const LinkModel& model) {
  inflation_.setZero(3 * markers(), kInflations);
  const Eigen::MatrixXd even = MarkerHarmonic(0);
  Eigen::VectorXd loads = Eigen::VectorXd::Zero(3 * rings_);
  for (int k = 0; k < kInflations; ++k) {
    for (int ring = 0; ring < rings_; ++ring) {
      const double z = model.markers.rings_z_mm[static_cast<size_t>(ring)];
      loads[3 * ring] = -CellArea(model, ring) * std::sin((k + 1) * kPi * z / model.length_mm);
    }
    const Eigen::VectorXd answer = even * loads;
    for (int m = 0; m < markers(); ++m)
      inflation_.block<3, 1>(3 * m, k) = answer.segment<3>(3 * model.RingOf(m));
  }
}

// White noise on the loads of all markers splits into independent waves round the axis, two of each harmonic.
void SkinBasis::FindModes(const LinkModel& model, const SkinBasisOptions& options) {
  Eigen::VectorXd load_sigma(3 * rings_);
  for (int ring = 0; ring < rings_; ++ring) {
    load_sigma.segment<3>(3 * ring).setConstant(
        options.stray_load_n * std::sqrt(CellArea(model, ring) / options.reference_area_mm2));
  }
  std::vector<Mode> all;
  for (int h = 0; 2 * h <= paths_; ++h) {
    const bool single = h == 0 || 2 * h == paths_;  // sin(h angle) is zero at all paths
    for (const bool partner : {false, true}) {
      Eigen::MatrixXd answer = MarkerHarmonic(h);
      for (Eigen::Index i = 0; single && i < answer.rows(); ++i) {
        if ((i % 3 == kAround) == partner) continue;
        answer.row(i).setZero();
        answer.col(i).setZero();
      }
      answer *= load_sigma.asDiagonal();
      answer *= std::sqrt((single ? 1.0 : 2.0) / paths_);
      const Eigen::SelfAdjointEigenSolver<Eigen::MatrixXd> eigen(answer * answer.transpose());
      for (Eigen::Index i = 0; i < answer.rows(); ++i) {
        Mode mode{h, partner, 0,
                  eigen.eigenvectors().col(i) * std::sqrt(std::max(0.0, eigen.eigenvalues()[i]))};
        mode.peak_mm = mode.amplitude.cwiseAbs().maxCoeff();
        all.push_back(std::move(mode));
      }
    }
  }
  std::stable_sort(all.begin(), all.end(),
                   [](const Mode& a, const Mode& b) { return a.peak_mm > b.peak_mm; });
  size_t kept = 0;
  while (kept < all.size() && kept < static_cast<size_t>(options.max_modes) &&
         all[kept].peak_mm >= options.least_mode_mm)
    ++kept;
  modes_.resize(3 * markers(), static_cast<Eigen::Index>(kept));
  remainder_.assign(static_cast<size_t>(rings_), Mat3::Zero());
  for (size_t k = 0; k < all.size(); ++k) {
    const Mode& mode = all[k];
    if (k < kept) harmonics_.push_back(mode.harmonic);
    for (int m = 0; m < markers(); ++m) {
      const double turn = 2 * kPi * mode.harmonic * model.PathOf(m) / paths_;
      const double even = mode.partner ? std::sin(turn) : std::cos(turn);
      const double odd = mode.partner ? -std::cos(turn) : std::sin(turn);
      const Vec3 u = Vec3(even, odd, even).cwiseProduct(mode.amplitude.segment<3>(3 * model.RingOf(m)));
      if (k < kept) {
        modes_.block<3, 1>(3 * m, static_cast<Eigen::Index>(k)) = u;
      } else {
        remainder_[static_cast<size_t>(model.RingOf(m))] += u * u.transpose() / paths_;
      }
    }
  }
}

int SkinBasis::MarkerOf(int field) const {
  if (IsWave(field)) {
    const int wave = (field - first_wave()) / wave_rings(),
              column = InwardColumn((field - first_wave()) % wave_rings());
    const int path = IsSine(wave) ? (paths_ + 2 * HarmonicOf(wave)) / (4 * HarmonicOf(wave)) : 0;
    return ring_of_column_[static_cast<size_t>(column)] * paths_ + path;
  }
  if (!IsLoad(field)) return (field - loads()) % (3 * markers()) / 3;
  return ring_of_column_[static_cast<size_t>(field / paths_)] * paths_ + field % paths_;
}

SkinBasis::HalfGrid SkinBasis::PlaceOf(int field) const {
  const int column = IsLoad(field) ? field / paths_ : 0;
  if (column < 3 * rings_) return {2 * (MarkerOf(field) % paths_), 2 * (MarkerOf(field) / paths_) + 1};
  if (column < columns_on_paths_) return {2 * (field % paths_), 2 * (column - 3 * rings_)};
  return {2 * (field % paths_) + 1, column - columns_on_paths_};
}

int SkinBasis::InwardAt(HalfGrid place) const {
  const int turned = (place.path % (2 * paths_) + 2 * paths_) % (2 * paths_);
  const bool on_path = turned % 2 == 0, on_ring = place.ring % 2 == 1;
  if (place.ring < 0 || place.ring > 2 * rings_) return -1;
  if (columns_on_paths_ == 3 * rings_ && !(on_path && on_ring)) return -1;
  const int column = !on_path  ? columns_on_paths_ + place.ring
                     : on_ring ? 3 * (place.ring / 2)
                               : 3 * rings_ + place.ring / 2;
  return column * paths_ + turned / 2;
}

int SkinBasis::OnFirstPath(int field) const {
  if (IsWave(field)) return field;
  const int path = MarkerOf(field) % paths_;
  return IsLoad(field) ? field - path : field - 3 * path;
}

void SkinBasis::WriteField(int field, Eigen::Ref<Eigen::VectorXd> column) const {
  if (IsLoad(field)) return WriteLoad(field, column);
  if (IsWave(field)) return WriteWave(field, column);
  WriteBell(field, column);
}

void SkinBasis::WriteBell(int field, Eigen::Ref<Eigen::VectorXd>& column) const {
  const int width = (field - loads()) / (3 * markers()), center = MarkerOf(field),
            component = (field - loads()) % 3;
  column.setZero();
  for (int m = 0; m < markers(); ++m) {
    const int between = std::abs(m % paths_ - center % paths_);
    column[3 * m + component] =
        Along(width)(center / paths_, m / paths_) * Around(width)(center / paths_, between);
  }
}

void SkinBasis::WriteLoad(int field, Eigen::Ref<Eigen::VectorXd>& column) const {
  const auto response = responses_.col(field / paths_);
  const Eigen::Index wrapped = 3 * (field % paths_), all = 3 * paths_;
  for (int ring = 0; ring < rings_; ++ring) {
    const Eigen::Index at = ring * all;
    column.segment(at + wrapped, all - wrapped) = response.segment(at, all - wrapped);
    column.segment(at, wrapped) = response.segment(at + all - wrapped, wrapped);
  }
}

void SkinBasis::WriteWave(int field, Eigen::Ref<Eigen::VectorXd>& column) const {
  const int wave = (field - first_wave()) / wave_rings(), h = HarmonicOf(wave);
  const auto amplitudes = wave_amplitudes_.col(field - first_wave());
  for (int m = 0; m < markers(); ++m) {
    const double angle = 2 * kPi * h * (m % paths_) / paths_, c = std::cos(angle), s = std::sin(angle);
    const Vec3 shape = IsSine(wave) ? Vec3(s, -c, s) : Vec3(c, s, c);
    column.segment<3>(3 * m) = shape.cwiseProduct(amplitudes.segment<3>(3 * (m / paths_)));
  }
}

}  // namespace taclink
