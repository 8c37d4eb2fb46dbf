#pragma once

#include <string>
#include <vector>

#include "sensing/core/link_model.h"
#include "sensing/core/link_state.h"
#include "server/events/event.h"

namespace taclink::server {

/// Which force level a link, or a region of it, is at. What counts is the magnitude of the strongest
/// contact, by the share of its load that lies there. While nothing is measured the level stays.
class ForceWatch {
 public:
  /// No region: the whole link.
  ForceWatch(std::string name, const Thresholds& thresholds, std::vector<bool> markers = {})
      : name_(std::move(name)), thresholds_(thresholds), markers_(std::move(markers)) {}

  void Take(const LinkState& state, std::vector<ForceLevelDetail>& told);

  void SetThresholds(const Thresholds& thresholds) { thresholds_ = thresholds; }
  const Thresholds& thresholds() const { return thresholds_; }
  ForceLevel level() const { return level_; }
  double force_n() const { return force_n_; }  ///< of the newest measured frame
  const std::string& name() const { return name_; }

 private:
  double ForceOf(const Contact& contact, const LinkState& state) const;
  ForceLevel LevelAt(double force_n) const;

  const std::string name_;
  Thresholds thresholds_;
  const std::vector<bool> markers_;  // by marker: within; empty: all
  ForceLevel level_ = ForceLevel::kNormal;
  double force_n_ = 0;
};

/// By marker: within the region.
std::vector<bool> MarkersOf(const Region& region, const MarkerGrid& grid);

}  // namespace taclink::server
