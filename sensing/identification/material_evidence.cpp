#include "sensing/identification/material_evidence.h"

#include <Eigen/Eigenvalues>
#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <map>

#include "sensing/core/median.h"

namespace taclink {
namespace {

// Squared residual over its record's variance, by number of directions; a normal error exceeds it once in
// some 1e6 times.
constexpr std::array<double, 4> kOutlier = {0, 24, 28, 31};
// Median of the chi-squared distribution.
constexpr std::array<double, 4> kMedian = {1, 0.455, 1.386, 2.366};
constexpr int kFewestToJudge = 6;
constexpr double kLeastVariance = 0.05;  // about the stated deviation nothing is an outlier

// Rows of the result times an error are independent, with standard deviation 1.
Mat3 Whitening(const Mat3& information, int& dims) {
  const Eigen::SelfAdjointEigenSolver<Mat3> eigen(information);
  const Vec3& values = eigen.eigenvalues();
  const double least = 1e-9 * values.maxCoeff();
  Vec3 roots;
  dims = 0;
  for (int i = 0; i < 3; ++i) {
    const bool told = values[i] > least;
    roots[i] = told ? std::sqrt(values[i]) : 0;
    dims += told ? 1 : 0;
  }
  return roots.asDiagonal() * eigen.eigenvectors().transpose();
}

struct WhiteMarker {
  int record, marker, ring, dims;
  Vec3 measured;
  Eigen::Matrix<double, 3, 2> by_growth;  // by radial and axial displacement
};

std::vector<WhiteMarker> WhiteMarkers(const LinkModel& model, std::span<const InflationRecord> records) {
  std::vector<WhiteMarker> all;
  for (size_t r = 0; r < records.size(); ++r) {
    for (int marker = 0; marker < model.markers.count(); ++marker) {
      const MeasuredDisplacement& seen = records[r].markers[static_cast<size_t>(marker)];
      if (!(seen.information_per_mm2.trace() > 0)) continue;
      WhiteMarker white{static_cast<int>(r), marker, model.RingOf(marker), 0, {}, {}};
      const Mat3 whitening = Whitening(seen.information_per_mm2, white.dims);
      const double angle = model.PathAngle(model.PathOf(marker));
      white.measured = whitening * seen.displacement_mm;
      white.by_growth.col(0) = whitening * Vec3(std::cos(angle), std::sin(angle), 0);
      white.by_growth.col(1) = whitening.col(2);
      all.push_back(white);
    }
  }
  return all;
}

double Sigma(const ProbeRecord& record, const MaterialFitOptions& options) {
  return std::hypot(options.force_sigma_n, options.force_sigma_share * record.force_n);
}

SkinResponse::Disc DiscOf(const ProbeRecord& record) {
  return {record.ring, record.depth_mm, record.diameter_mm};
}

Error At(const std::string& name, const Error& error) {
  return {error.code, name + ": " + error.message};
}

}  // namespace

EvidenceAt InflationEvidence(const LinkModel& model, SkinResponse& response,
                             std::span<const InflationRecord> records) {
  return [markers = WhiteMarkers(model, records), &response,
          records](double modulus) -> Result<Observations> {
    std::vector<SkinResponse::Growth> growths;
    for (const InflationRecord& record : records) {
      auto growth = response.GrowthAt(record.pressure_mpa / modulus);
      if (!growth) return At(record.name, growth.error());
      growths.push_back(*std::move(growth));
    }
    Observations all;
    all.reserve(markers.size());
    for (const WhiteMarker& white : markers) {
      const auto r = static_cast<size_t>(white.record), ring = static_cast<size_t>(white.ring);
      const double s = records[r].pressure_mpa / modulus;
      all.push_back({white.record, white.marker, white.dims, white.measured,
                     white.by_growth * growths[r].mm[ring], white.by_growth * (-s * growths[r].by_s[ring])});
    }
    return all;
  };
}

EvidenceAt ProbeEvidence(SkinResponse& response, std::span<const ProbeRecord> records,
                         const MaterialFitOptions& options) {
  return [&response, records, options](double modulus) -> Result<Observations> {
    Observations all;
    for (size_t r = 0; r < records.size(); ++r) {
      const ProbeRecord& record = records[r];
      const auto push = response.PushAt(DiscOf(record), record.pressure_mpa / modulus);
      if (!push) return At(record.name, push.error());
      const double scale = 1 / Sigma(record, options);
      const double by_log = modulus * push->mm2 - record.pressure_mpa * push->by_s;
      all.push_back({static_cast<int>(r), -1, 1, Vec3(scale * record.force_n, 0, 0),
                     Vec3(scale * modulus * push->mm2, 0, 0), Vec3(scale * by_log, 0, 0)});
    }
    return all;
  };
}

Result<double> LinearModulus(const LinkModel& model, SkinResponse& response,
                             std::span<const InflationRecord> records) {
  const auto growth = response.GrowthAt(0);
  if (!growth) return growth.error();
  std::vector<double> compliances;
  for (const WhiteMarker& white : WhiteMarkers(model, records)) {
    const double p = records[static_cast<size_t>(white.record)].pressure_mpa;
    const Vec3 per_compliance = p * white.by_growth * growth->by_s[static_cast<size_t>(white.ring)];
    const double squared = per_compliance.squaredNorm();
    if (squared > 0) compliances.push_back(per_compliance.dot(white.measured) / squared);
  }
  return compliances.empty() ? 0 : 1 / Median(compliances);
}

// F = a E + b p: what the pressure adds does not depend on E while displacements are small.
Result<double> LinearModulus(SkinResponse& response, std::span<const ProbeRecord> records,
                             const MaterialFitOptions& options) {
  double above = 0, below = 0;
  for (const ProbeRecord& record : records) {
    const auto push = response.PushAt(DiscOf(record), 0);
    if (!push) return At(record.name, push.error());
    const double sigma = Sigma(record, options), a = push->mm2 / sigma;
    above += a * (record.force_n - push->by_s * record.pressure_mpa) / sigma;
    below += a * a;
  }
  return below > 0 ? above / below : 0;
}

std::vector<bool> OutliersOf(const Observations& observations) {
  std::vector<bool> outliers(observations.size(), false);
  std::map<int, std::vector<double>> scaled;  // the forces are one record
  const auto group = [](const Observation& o) { return o.marker < 0 ? -1 : o.record; };
  for (const Observation& o : observations) {
    scaled[group(o)].push_back(o.residual().squaredNorm() / kMedian[static_cast<size_t>(o.dims)]);
  }
  std::map<int, double> variance;
  for (auto& [record, values] : scaled) {
    variance[record] = static_cast<int>(values.size()) < kFewestToJudge
                           ? std::numeric_limits<double>::infinity()
                           : std::max(Median(values), kLeastVariance);
  }
  for (size_t i = 0; i < observations.size(); ++i) {
    const Observation& o = observations[i];
    outliers[i] = o.residual().squaredNorm() > kOutlier[static_cast<size_t>(o.dims)] * variance[group(o)];
  }
  return outliers;
}

EvidenceSums Sum(const Observations& observations, const std::vector<bool>& outliers, int record) {
  EvidenceSums sums;
  for (size_t i = 0; i < observations.size(); ++i) {
    const Observation& o = observations[i];
    if (outliers[i] || (record >= 0 && o.record != record)) continue;
    sums.values += o.dims;
    sums.chi2 += o.residual().squaredNorm();
    sums.measured2 += o.measured.squaredNorm();
    sums.curvature += o.by_log.squaredNorm();
    sums.gradient += o.by_log.dot(o.residual());
  }
  return sums;
}

Minimum Minimise(const std::function<double(double)>& cost, double start) {
  constexpr double kFirst = 0.05, kGrow = 1.4, kTolerance = 1e-6, kGolden = 0.381966;
  double x = start, value = cost(x);
  for (int i = 0; i < 40 && std::isinf(value); ++i) value = cost(x += 0.25);
  double low = x - kFirst, high = x + kFirst;
  double at_low = cost(low), at_high = cost(high);
  for (double step = kFirst * kGrow; at_low < value || at_high < value; step *= kGrow) {
    const bool down = at_low < at_high;
    (down ? high : low) = x;
    (down ? at_high : at_low) = value;
    x = down ? low : high;
    value = down ? at_low : at_high;
    (down ? low : high) = x + (down ? -step : step);
    (down ? at_low : at_high) = cost(down ? low : high);
  }
  while (high - low > kTolerance) {
    const bool left = x - low > high - x;
    const double next = left ? x - kGolden * (x - low) : x + kGolden * (high - x);
    const double there = cost(next);
    if (there < value) {
      (left ? high : low) = x;
      x = next;
      value = there;
    } else {
      (left ? low : high) = next;
    }
  }
  const double near = 1e-4;
  return {x, value, std::isinf(cost(x - near)) || std::isinf(cost(x + near))};
}

}  // namespace taclink
