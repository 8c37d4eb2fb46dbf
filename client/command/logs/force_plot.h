#pragma once

#include <cstdint>
#include <map>
#include <optional>
#include <set>
#include <string>
#include <vector>

#include "client/command/logs/trace.h"

namespace taclink::command {

/// Forces over time, one panel a link. Times: s, on the plot's own axis; forces: N.
class ForcePlot {
 public:
  /// Above so many frames a panel's curves are decimated.
  static constexpr size_t kExactFrames = 2000;
  /// Of a link; what more there are is counted, and said in the plot.
  static constexpr size_t kMostContacts = 5000;

  struct ContactForce {
    uint64_t id = 0;
    double magnitude_n = 0;
  };

  /// `start_s` < `end_s`: the time axis.
  ForcePlot(std::string title, double start_s, double end_s);

  /// In order of time. `total_n`: sum of the contacts' magnitudes; none: nothing was measured.
  void AddFrame(const std::string& link, double time_s, std::optional<double> total_n,
                const std::vector<ContactForce>& contacts);
  void AddContactBegin(const std::string& link, double time_s);
  void AddContactEnd(const std::string& link, double time_s);

  bool empty() const { return panels_.empty(); }
  std::string Svg() const;

 private:
  struct ContactTrace {
    Trace trace;
    uint64_t last_frame = 0;
  };
  struct Panel {
    explicit Panel(Trace trace) : total(std::move(trace)) {}

    Trace total;
    std::map<uint64_t, ContactTrace> contacts;  // by id
    std::set<uint64_t> not_drawn;               // ids; bounded as the contacts are
    uint64_t frames = 0;
    double least = 0, most = 0;
  };
  struct Marks {
    std::set<int> begins, ends;  // columns
  };
  struct Place;

  Trace NewTrace() const;
  Panel& PanelOf(const std::string& link);
  int ColumnOf(double time_s) const;
  double XOf(double time_s) const;
  std::string Head(double height) const;
  std::string TimeAxis(const Place& place, bool labelled) const;
  std::string ForceAxis(const Place& place) const;
  std::string Curve(const Trace& trace, const Place& place, const std::string& style) const;
  std::string MarksOf(const std::string& link, const Place& place) const;
  std::string Draw(const std::string& link, const Panel& panel, const Place& place, bool last) const;

  const std::string title_;
  const double start_s_;
  const double end_s_;
  std::map<std::string, Panel> panels_;  // links with frames
  std::map<std::string, Marks> marks_;
};

}  // namespace taclink::command
