#pragma once

#include <cmath>
#include <cstddef>
#include <vector>

namespace taclink::command {

/// A curve over time, to be drawn `columns` pixels wide. Decimated, it keeps the least and the largest value
/// of each column, at their times: what is drawn stays the same to a pixel, and memory is bounded by the
/// columns.
class Trace {
 public:
  struct Point {
    double time_s = 0;
    double value = 0;
    bool begins = false;  ///< no line leads here from the point before
  };

  Trace(double start_s, double end_s, size_t columns)
      : start_s_(start_s),
        columns_per_s_(static_cast<double>(columns) / (end_s - start_s)),
        last_column_(static_cast<double>(columns) - 1) {}

  /// In order of time, between the two. Not finite: nothing was measured, the line is broken.
  void Add(double time_s, double value);
  /// What is there, and what will come.
  void Decimate();
  std::vector<Point> Points() const;
  bool empty() const { return points_.empty() && columns_.empty(); }

 private:
  struct Column {
    double number = 0;
    Point least, most;
    bool begins = false;
  };
  void AddToColumn(const Point& point);

  double start_s_;
  double columns_per_s_;
  double last_column_;
  bool broken_ = true;
  bool decimated_ = false;
  std::vector<Point> points_;    // until decimated
  std::vector<Column> columns_;  // from then on
};

}  // namespace taclink::command
