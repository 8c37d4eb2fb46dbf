#include "sensing/contact/contact_writer.h"

#include <Eigen/Eigenvalues>
#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <map>

namespace taclink {
namespace {

constexpr double kLoaded = 0.1;  // of the peak pressure: within a contact

// Monotone chain [andrew1979]; counter-clockwise.
std::vector<Vec2> ConvexHull(std::vector<Vec2> points) {
  const auto less = [](const Vec2& a, const Vec2& b) {
    return a.x() != b.x() ? a.x() < b.x() : a.y() < b.y();
  };
  std::sort(points.begin(), points.end(), less);
  std::vector<Vec2> hull;
  const auto turn = [](const Vec2& o, const Vec2& a, const Vec2& b) {
    return (a - o).x() * (b - o).y() - (a - o).y() * (b - o).x();
  };
  for (int pass = 0; pass < 2; ++pass) {
    const size_t first = hull.size();
    for (const Vec2& p : points) {
      while (hull.size() >= first + 2 && turn(hull[hull.size() - 2], hull.back(), p) <= 0) hull.pop_back();
      hull.push_back(p);
    }
    hull.pop_back();
    std::reverse(points.begin(), points.end());
  }
  return hull;
}

}  // namespace

ContactWriter::ContactWriter(SkinEstimator& estimator, const SkinEstimate& estimate)
    : mechanics_(estimator.mechanics()), skin_(estimator.linearization()), estimate_(estimate) {}

Vec3 ContactWriter::OuterPoint(int site) const {
  return estimate_.state.AtOffset(mechanics_.NodeOfSite(site), mechanics_.model().thickness_mm / 2);
}

// Bilinear between sites; beyond the first and the last row as far as the clamps.
Vec3 ContactWriter::OuterPointAt(double column, double row) const {
  const ShellMesh& mesh = mechanics_.mesh();
  const double node_row = std::clamp(row + 1, 0.0, mesh.rows - 1.0);
  const int r0 = std::min(static_cast<int>(node_row), mesh.rows - 2),
            c0 = static_cast<int>(std::floor(column));
  const double u = node_row - r0, w = column - c0;
  const auto at = [&](int r, int c) {
    return estimate_.state.AtOffset(mesh.Node(c, r), mechanics_.model().thickness_mm / 2);
  };
  return (1 - u) * ((1 - w) * at(r0, c0) + w * at(r0, c0 + 1)) +
         u * ((1 - w) * at(r0 + 1, c0) + w * at(r0 + 1, c0 + 1));
}

int ContactWriter::FromOrigin(int site) const {
  const int columns = mechanics_.columns();
  return (site % columns - origin_ + columns + columns / 2) % columns - columns / 2;
}

void ContactWriter::Spread(const EstimatedLoad& load) {
  std::map<int, SiteLoad> sum;
  for (size_t k = 0; k < load.sites.size(); ++k) {
    for (Eigen::SparseMatrix<double>::InnerIterator it(mechanics_.spread(), load.sites[k]); it; ++it) {
      const auto site = static_cast<int>(it.row());
      const Mat3& frame = skin_.frames()[static_cast<size_t>(site)];
      SiteLoad& at = sum[site];
      at.site = site;
      at.inward_n += it.value() * load.inward_n[k];
      at.force_n += it.value() * (load.inward_n[k] * frame.col(0) +
                                  load.shares[k] * (frame.rightCols<2>() * load.tangential_n));
    }
  }
  spread_.clear();
  peak_mpa_ = 0;
  for (const auto& [site, at] : sum) {
    spread_.push_back(at);
    const double pressure =
        at.inward_n / mechanics_.mesh().areas_mm2[static_cast<size_t>(mechanics_.NodeOfSite(site))];
    if (pressure > peak_mpa_) origin_ = site % mechanics_.columns();
    peak_mpa_ = std::max(peak_mpa_, pressure);
  }
}

// Where the load is, how far it reaches, and the area on which it presses.
void ContactWriter::WriteShape(const EstimatedLoad& load, Contact& contact) {
  contact.center_mm = OuterPointAt(load.center.x(), load.center.y());
  Vec3 around = OuterPointAt(load.center.x() + 0.5, load.center.y()) -
                OuterPointAt(load.center.x() - 0.5, load.center.y());
  Vec3 along = OuterPointAt(load.center.x(), load.center.y() + 0.5) -
               OuterPointAt(load.center.x(), load.center.y() - 0.5);
  contact.normal = around.cross(along).normalized();
  Eigen::Matrix<double, 3, 2> pitch;
  pitch << around, along;
  contact.center_covariance_mm2 = pitch * load.center_covariance * pitch.transpose();
  // A node's load is spread over its cell, which is one pitch wide.
  const Mat2 of_cell = Vec2(around.squaredNorm(), along.squaredNorm()).asDiagonal() * (1.0 / 12);
  Mat2 second = Mat2::Zero();
  double sum = 0;
  const double middle = std::remainder(load.center.x() - origin_, mechanics_.columns());
  contact.area_mm2 = 0;
  for (const SiteLoad& at : spread_) {
    const double area = mechanics_.mesh().areas_mm2[static_cast<size_t>(mechanics_.NodeOfSite(at.site))];
    const Vec2 off(FromOrigin(at.site) - middle, at.site / mechanics_.columns() - load.center.y());
    const Vec2 off_mm(off.x() * around.norm(), off.y() * along.norm());
    second += at.inward_n * (off_mm * off_mm.transpose() + of_cell);
    sum += at.inward_n;
    if (at.inward_n > kLoaded * peak_mpa_ * area) contact.area_mm2 += area;
  }
  if (load.is_ring_contact) {
    contact.center_mm.setZero();
    for (const SiteLoad& at : spread_) contact.center_mm += at.inward_n / sum * OuterPoint(at.site);
  }
  const Eigen::SelfAdjointEigenSolver<Mat2> axes(second / std::max(sum, 1e-12));
  const auto axis = [&](Eigen::Index k) {
    const Vec2 v = axes.eigenvectors().col(k);
    return Vec3(std::sqrt(std::max(axes.eigenvalues()[k], 0.0)) *
                (v.x() * around.normalized() + v.y() * along.normalized()));
  };
  contact.major_axis_mm = axis(1);
  contact.minor_axis_mm = axis(0);
}

void ContactWriter::WriteOutline(Contact& contact) {
  std::vector<Vec2> corners;
  for (const SiteLoad& at : spread_) {
    const double area = mechanics_.mesh().areas_mm2[static_cast<size_t>(mechanics_.NodeOfSite(at.site))];
    if (at.inward_n <= kLoaded * peak_mpa_ * area) continue;
    const Vec2 middle(FromOrigin(at.site), at.site / mechanics_.columns());
    for (const double x : {-0.5, 0.5}) {
      for (const double y : {-0.5, 0.5}) corners.push_back(middle + Vec2(x, y));
    }
  }
  contact.outline_mm.clear();
  const std::vector<Vec2> hull = ConvexHull(std::move(corners));
  for (size_t i = 0; i < hull.size(); ++i) {
    // No chord through the link: a point for each site that the edge passes.
    const Vec2 edge = hull[(i + 1) % hull.size()] - hull[i];
    const int parts = std::max(1, static_cast<int>(std::ceil(edge.cwiseAbs().maxCoeff())));
    for (int k = 0; k < parts; ++k) {
      const Vec2 point = hull[i] + static_cast<double>(k) / parts * edge;
      contact.outline_mm.push_back(OuterPointAt(origin_ + point.x(), point.y()));
    }
  }
}

void ContactWriter::WriteMarkers(Contact& contact) const {
  const LinkModel& model = mechanics_.model();
  const ShellMesh& mesh = mechanics_.mesh();
  contact.markers.clear();
  for (const SiteLoad& at : spread_) {
    const int node = mechanics_.NodeOfSite(at.site);
    const double area = mesh.areas_mm2[static_cast<size_t>(node)];
    if (at.inward_n <= kLoaded * peak_mpa_ * area) continue;
    const int path = static_cast<int>(std::lround(static_cast<double>(mesh.Column(node)) / mesh.refinement)) %
                     model.markers.paths;
    const int ring = std::clamp(
        static_cast<int>(std::lround(static_cast<double>(mesh.Row(node)) / mesh.refinement_along)) - 1, 0,
        model.markers.rings() - 1);
    const int marker = model.MarkerIndex(path, ring);
    if (std::find(contact.markers.begin(), contact.markers.end(), marker) == contact.markers.end())
      contact.markers.push_back(marker);
  }
  std::sort(contact.markers.begin(), contact.markers.end());
}

void ContactWriter::Write(const EstimatedLoad& load, Contact& contact) {
  Spread(load);
  contact.is_ring_contact = load.is_ring_contact;
  contact.force_n = load.force_n;
  contact.normal_force_n = load.normal_force_n;
  contact.force_covariance_n2 = load.force_covariance_n2;
  contact.peak_pressure_mpa = peak_mpa_;
  contact.moment_nmm.setZero();
  for (const SiteLoad& at : spread_) contact.moment_nmm += OuterPoint(at.site).cross(at.force_n);
  for (size_t k = 0; k < load.sites.size(); ++k)
    contact.moment_nmm +=
        load.shares[k] *
        (skin_.frames()[static_cast<size_t>(load.sites[k])].rightCols<2>() * load.couple_nmm);
  WriteShape(load, contact);
  WriteOutline(contact);
  WriteMarkers(contact);
}

void ContactWriter::Lump(const EstimatedLoad& load, NodalForces& forces) {
  Spread(load);
  const LinkModel& model = mechanics_.model();
  const ShellMesh& mesh = mechanics_.mesh();
  const int paths = model.markers.paths, rings = model.markers.rings();
  const double variance = load.force_covariance_n2.trace();
  const double size = std::max(load.normal_force_n, 1e-12);
  for (const SiteLoad& at : spread_) {
    const int node = mechanics_.NodeOfSite(at.site);
    const double path = static_cast<double>(mesh.Column(node)) / mesh.refinement;
    const double ring =
        std::clamp(static_cast<double>(mesh.Row(node)) / mesh.refinement_along - 1, 0.0, rings - 1.0);
    const int path_0 = static_cast<int>(path),
              ring_0 = std::min(static_cast<int>(ring), std::max(rings - 2, 0));
    const double a = path - path_0, b = ring - ring_0;
    for (int i = 0; i < 4; ++i) {
      const double share = (i % 2 == 0 ? 1 - a : a) * (i / 2 == 0 ? 1 - b : b);
      if (share == 0) continue;
      const auto m = static_cast<size_t>(model.MarkerIndex((path_0 + i % 2) % paths, ring_0 + i / 2));
      forces.forces_n[m] += share * at.force_n;
      forces.sigmas_n[m] += share * at.inward_n / size * std::sqrt(variance);
    }
  }
}

}  // namespace taclink
