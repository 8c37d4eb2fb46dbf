#pragma once

#include <cmath>
#include <utility>
#include <vector>

#include "sensing/core/link_model.h"

namespace taclink {

/// Quasi-linear viscoelasticity [fung1993, section 7.6]: the external force of a material, from the history
/// of its elastic force, which it would exert if it were elastic with E(0),
///   external(t) = integral of g(t - s) d elastic(s),  g(t) = E(t) / E(0), the Relaxation's Prony series.
/// Each term has one internal force H_i with dH_i/dt = share_i d elastic/dt - H_i / time_i, which is
/// integrated exactly for an elastic force that is linear in time between two calls [simo1998, section 10.3]:
///   H_i' = e^-x H_i + share_i (1 - e^-x) / x (elastic' - elastic),  x = dt / time_i,
///   external = (1 - sum of shares) elastic + sum of H_i.
/// For one step, external = Instant(dt) elastic + Memory(dt), which is solved for the elastic force under a
/// known external force (creep). Both directions are exact inverses for any steps. A step of 0 s is a jump.
/// An empty Relaxation is the identity.
///
/// `Value` is a double or an Eigen column of N or MPa. The relation is linear: linear combinations may be
/// formed before or after the filter. A value type; no errors: the caller checks that dt_s >= 0 and that
/// numbers are finite.
template <typename Value>
class RelaxationFilter {
 public:
  /// Starts relaxed: the elastic force has been constant for long.
  RelaxationFilter(const Relaxation& relaxation, Value elastic)
      : terms_(relaxation.terms), elastic_(std::move(elastic)) {
    memory_.assign(terms_.size(), Value(0 * elastic_));
  }

  /// E(infinity) / E(0).
  double Relaxed() const {
    double rest = 1;
    for (const RelaxationTerm& term : terms_) rest -= term.share;
    return rest;
  }
  /// External force per elastic force that is added during the next dt_s.
  double Instant(double dt_s) const {
    double share = Relaxed();
    for (const RelaxationTerm& term : terms_) share += term.share * MeanDecay(dt_s / term.time_s);
    return share;
  }
  /// Contribution of the history after dt_s: the external force less Instant(dt_s) times the elastic force.
  Value Memory(double dt_s) const {
    Value sum = 0 * elastic_;
    for (size_t i = 0; i < terms_.size(); ++i) {
      const double x = dt_s / terms_[i].time_s;
      sum += std::exp(-x) * memory_[i] - terms_[i].share * MeanDecay(x) * elastic_;
    }
    return sum;
  }
  Value ToExternal(const Value& elastic, double dt_s) const { return Instant(dt_s) * elastic + Memory(dt_s); }
  Value ToElastic(const Value& external, double dt_s) const {
    return (external - Memory(dt_s)) / Instant(dt_s);
  }

  /// Advances by dt_s, in which the elastic force changes linearly to `elastic`.
  void Advance(const Value& elastic, double dt_s) {
    for (size_t i = 0; i < terms_.size(); ++i) {
      const double x = dt_s / terms_[i].time_s;
      memory_[i] = std::exp(-x) * memory_[i] + terms_[i].share * MeanDecay(x) * (elastic - elastic_);
    }
    elastic_ = elastic;
  }

  /// The elastic force of the last Advance.
  const Value& elastic() const { return elastic_; }
  /// d external / d share_i at the last Advance: the more a term relaxes, the less force is left.
  Value ByShare(size_t term) const { return memory_[term] / terms_[term].share - elastic_; }
  size_t terms() const { return terms_.size(); }

  /// Sets the internal forces, in proportion to the shares, so that the external force is this one now. With
  /// one term they are unique; with several this is the least that a history may have left.
  void SetExternal(const Value& external) {
    if (terms_.empty()) return;
    const Value left = external - Relaxed() * elastic_;
    for (size_t i = 0; i < terms_.size(); ++i) memory_[i] = terms_[i].share / (1 - Relaxed()) * left;
  }

 private:
  /// (1 - e^-x) / x
  static double MeanDecay(double x) { return x > 0 ? -std::expm1(-x) / x : 1; }

  std::vector<RelaxationTerm> terms_;
  std::vector<Value> memory_;  // H_i
  Value elastic_;
};

}  // namespace taclink
