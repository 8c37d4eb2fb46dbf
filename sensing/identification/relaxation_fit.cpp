#include "sensing/identification/relaxation_fit.h"

#include <Eigen/Cholesky>
#include <Eigen/Core>
#include <algorithm>
#include <cmath>
#include <cstdio>
#include <limits>
#include <optional>
#include <utility>

#include "sensing/core/relaxation_filter.h"

namespace taclink {
namespace {

constexpr size_t kLeastSamples = 20;
constexpr double kMostShares = 0.9;     // sum over all terms, at most: beyond it the skin would flow
constexpr double kLeastDeviations = 3;  // of a share, to be distinguished from noise
constexpr double kMostTimeSigma = 1;    // standard deviation of a time constant's logarithm, at most
constexpr double kSchwarzGain = 10;     // "very strong" [kass1995]
constexpr int kMostIterations = 30, kGridTimes = 4;
constexpr double kFirstShare = 0.03;  // initial value
constexpr double kLeastGain = 1e-6;   // relative decrease of chi^2 in an iteration, at least

// `parameters`: shares and logarithms of time constants, alternating.
Relaxation SeriesOf(const Eigen::VectorXd& parameters) {
  Relaxation series;
  for (Eigen::Index i = 0; i + 1 < parameters.size(); i += 2)
    series.terms.push_back({parameters[i], std::exp(parameters[i + 1])});
  return series;
}

bool IsSeries(const Eigen::VectorXd& parameters, double least_s, double most_s) {
  double sum = 0;
  for (Eigen::Index i = 0; i + 1 < parameters.size(); i += 2) {
    const double time_s = std::exp(parameters[i + 1]);
    if (!(parameters[i] > 0) || !(time_s > least_s && time_s < most_s)) return false;
    sum += parameters[i];
  }
  return sum < kMostShares;
}

// Residuals of all records in one column, with the best gain for each record.
Eigen::VectorXd Residuals(std::span<const RelaxationRecord> records, const Relaxation& series) {
  size_t count = 0;
  for (const RelaxationRecord& record : records) count += record.samples.size();
  Eigen::VectorXd residuals(static_cast<Eigen::Index>(count));
  Eigen::Index begin = 0;
  for (const RelaxationRecord& record : records) {
    const auto size = static_cast<Eigen::Index>(record.samples.size());
    RelaxationFilter<double> skin(series, 0);
    Eigen::VectorXd apparent(size), crept(size);
    double time_s = record.samples.front().time_s;
    for (Eigen::Index i = 0; i < size; ++i) {
      const RelaxationRecord::Sample& sample = record.samples[static_cast<size_t>(i)];
      crept[i] = skin.ToElastic(sample.reference_n, sample.time_s - time_s);
      skin.Advance(crept[i], sample.time_s - time_s);
      time_s = sample.time_s;
      apparent[i] = sample.apparent_n;
    }
    residuals.segment(begin, size) = apparent - crept.dot(apparent) / crept.squaredNorm() * crept;
    begin += size;
  }
  return residuals;
}

struct SeriesFit {
  Eigen::VectorXd parameters;
  Eigen::MatrixXd covariance;  // in units of the residuals' variance
  double chi2 = std::numeric_limits<double>::infinity();
};

Eigen::MatrixXd DerivativesOf(std::span<const RelaxationRecord> records, const SeriesFit& fit) {
  constexpr double kStep = 1e-5;
  const Eigen::VectorXd now = Residuals(records, SeriesOf(fit.parameters));
  Eigen::MatrixXd derivatives(now.size(), fit.parameters.size());
  for (Eigen::Index i = 0; i < fit.parameters.size(); ++i) {
    Eigen::VectorXd moved = fit.parameters;
    moved[i] += kStep;
    derivatives.col(i) = (Residuals(records, SeriesOf(moved)) - now) / kStep;
  }
  return derivatives;
}

// [levenberg1944], [marquardt1963].
SeriesFit Descend(std::span<const RelaxationRecord> records, Eigen::VectorXd start, double least_s,
                  double most_s) {
  SeriesFit fit{.parameters = std::move(start), .covariance = {}};
  Eigen::VectorXd residuals = Residuals(records, SeriesOf(fit.parameters));
  fit.chi2 = residuals.squaredNorm();
  double damping = 1e-2;
  for (int i = 0; i < kMostIterations; ++i) {
    const Eigen::MatrixXd by = DerivativesOf(records, fit);
    const Eigen::MatrixXd information = by.transpose() * by;
    bool moved = false;
    while (!moved && damping < 1e8) {
      Eigen::MatrixXd damped = information;
      damped.diagonal() *= 1 + damping;
      const Eigen::VectorXd next = fit.parameters - damped.ldlt().solve(by.transpose() * residuals);
      const bool is_series = next.allFinite() && IsSeries(next, least_s, most_s);
      const Eigen::VectorXd left = is_series ? Residuals(records, SeriesOf(next)) : residuals;
      moved = is_series && left.squaredNorm() < fit.chi2;
      damping *= moved ? 0.2 : 8;
      if (!moved) continue;
      const double gain = (fit.chi2 - left.squaredNorm()) / fit.chi2;
      fit.parameters = next;
      residuals = left;
      fit.chi2 = left.squaredNorm();
      if (gain < kLeastGain) i = kMostIterations;
    }
    if (!moved) break;
  }
  const Eigen::MatrixXd by = DerivativesOf(records, fit);
  fit.covariance = (by.transpose() * by)
                       .ldlt()
                       .solve(Eigen::MatrixXd::Identity(fit.parameters.size(), fit.parameters.size()));
  return fit;
}

SeriesFit BestOf(std::span<const RelaxationRecord> records, const std::vector<Eigen::VectorXd>& starts,
                 double least_s, double most_s) {
  SeriesFit best;
  for (const Eigen::VectorXd& start : starts) {
    SeriesFit fit = Descend(records, start, least_s, most_s);
    if (fit.chi2 < best.chi2) best = std::move(fit);
  }
  return best;
}

// One term, from a grid of time constants; and two terms, from half the first one and the grid.
std::pair<SeriesFit, SeriesFit> FitSeries(std::span<const RelaxationRecord> records, double least_s,
                                          double most_s) {
  std::vector<Eigen::VectorXd> starts;
  for (int k = 0; k < kGridTimes; ++k) {
    const double time = std::log(least_s) + (k + 0.5) / kGridTimes * std::log(most_s / least_s);
    starts.emplace_back(Eigen::Vector2d(kFirstShare, time));
  }
  SeriesFit one = BestOf(records, starts, least_s, most_s);
  for (Eigen::VectorXd& start : starts)
    start = Eigen::Vector4d(one.parameters[0] / 2, one.parameters[1], start[0], start[1]);
  SeriesFit two = BestOf(records, starts, least_s, most_s);
  return {std::move(one), std::move(two)};
}

// Variance of a mean of residuals relative to that of independent residuals, for a first-order process with
// the correlation of successive residuals.
double VarianceFactor(const Eigen::VectorXd& residuals) {
  const Eigen::Index n = residuals.size() - 1;
  const double correlation = std::clamp(
      residuals.head(n).dot(residuals.tail(n)) / std::max(residuals.squaredNorm(), 1e-300), 0.0, 0.99);
  return (1 + correlation) / (1 - correlation);
}

std::optional<Error> Objection(std::span<const RelaxationRecord> records) {
  size_t samples = 0;
  for (const RelaxationRecord& record : records) {
    const auto wrong = [&](const std::string& why) {
      return Error{ErrorCode::kInvalidArgument, record.name + ": " + why};
    };
    bool presses = false;
    for (size_t i = 0; i < record.samples.size(); ++i) {
      const RelaxationRecord::Sample& sample = record.samples[i];
      if (!std::isfinite(sample.time_s + sample.apparent_n + sample.reference_n))
        return wrong("sample " + std::to_string(i + 1) + " is not finite");
      if (i > 0 && sample.time_s <= record.samples[i - 1].time_s)
        return wrong("the times do not rise at sample " + std::to_string(i + 1));
      presses = presses || sample.reference_n > 0;
    }
    if (!presses) return wrong("the reference force is never above 0: nothing presses");
    if (record.samples.size() < 2) return wrong("a single sample shows no creep");
    samples += record.samples.size();
  }
  if (samples < kLeastSamples)
    return Error{ErrorCode::kInvalidArgument, std::to_string(samples) +
                                                  " samples of a held force are too few: take " +
                                                  std::to_string(kLeastSamples) + " at least"};
  return std::nullopt;
}

// The shortest and the longest time constant that the records can show.
std::pair<double, double> TimesOf(std::span<const RelaxationRecord> records) {
  double shortest_s = std::numeric_limits<double>::infinity(), longest_s = 0;
  for (const RelaxationRecord& record : records) {
    const double span_s = record.samples.back().time_s - record.samples.front().time_s;
    shortest_s = std::min(shortest_s, span_s / static_cast<double>(record.samples.size()));
    longest_s = std::max(longest_s, span_s);
  }
  return {shortest_s, 2 * longest_s};
}

std::string Evidence(const SeriesFit& fit, size_t records, Eigen::Index samples, double sigma_n) {
  char text[160];
  std::snprintf(text, sizeof text, "%zu records of held forces, %td samples, %d terms, residual %.4f N",
                records, samples, static_cast<int>(fit.parameters.size() / 2), sigma_n);
  return text;
}

// Why the records do not determine this term. None: they do.
std::optional<Error> TermObjection(const RelaxationTerm& term, double sigma, double time_sigma) {
  char text[256];
  if (!(term.share > kLeastDeviations * sigma)) {
    std::snprintf(text, sizeof text,
                  "no creep is told from noise: a share of %.4f +- %.4f with %.1f s; hold a larger force for "
                  "longer, or use the model without relaxation",
                  term.share, sigma, term.time_s);
    return Error{ErrorCode::kFailedPrecondition, text};
  }
  if (time_sigma < kMostTimeSigma) return std::nullopt;
  std::snprintf(text, sizeof text,
                "the records do not determine the time constant of about %.0f s of a share of %.3f; hold the "
                "force for longer than that, with samples every %.2g s after each change",
                term.time_s, term.share, term.time_s / 10);
  return Error{ErrorCode::kFailedPrecondition, text};
}

}  // namespace

Result<Relaxation> FitRelaxation(std::span<const RelaxationRecord> records) {
  if (auto objection = Objection(records)) return *objection;
  const auto [least_s, most_s] = TimesOf(records);
  const auto [one, two] = FitSeries(records, least_s, most_s);
  const Eigen::Index samples = Residuals(records, SeriesOf(one.parameters)).size();
  const auto count = static_cast<double>(samples);
  const auto schwarz = [count](const SeriesFit& fit) {
    return count * std::log(fit.chi2 / count) + static_cast<double>(fit.parameters.size()) * std::log(count);
  };
  const SeriesFit& fit = schwarz(two) < schwarz(one) - kSchwarzGain ? two : one;
  const double variance =
      fit.chi2 / (count - static_cast<double>(fit.parameters.size()) - static_cast<double>(records.size()));
  const Eigen::MatrixXd covariance =
      VarianceFactor(Residuals(records, SeriesOf(fit.parameters))) * variance * fit.covariance;
  std::vector<std::pair<RelaxationTerm, double>> terms;  // with its share's standard deviation
  for (Eigen::Index i = 0; i < fit.parameters.size(); i += 2) {
    const RelaxationTerm term{fit.parameters[i], std::exp(fit.parameters[i + 1])};
    const double sigma = std::sqrt(covariance(i, i));
    if (auto objection = TermObjection(term, sigma, std::sqrt(covariance(i + 1, i + 1)))) return *objection;
    terms.emplace_back(term, sigma);
  }
  std::ranges::sort(terms, {}, [](const auto& term) { return term.first.time_s; });
  Relaxation result;
  for (const auto& [term, sigma] : terms) {
    result.terms.push_back(term);
    result.share_sigmas.push_back(sigma);
  }
  result.source = Evidence(fit, records.size(), samples, std::sqrt(variance));
  return result;
}

}  // namespace taclink
