#include "client/command/logs/trace.h"

#include <algorithm>

namespace taclink::command {

void Trace::Add(double time_s, double value) {
  if (!std::isfinite(value)) {
    broken_ = true;
    return;
  }
  const Point point{.time_s = time_s, .value = value, .begins = broken_};
  broken_ = false;
  if (decimated_) {
    AddToColumn(point);
  } else {
    points_.push_back(point);
  }
}

void Trace::Decimate() {
  decimated_ = true;
  for (const Point& point : points_) AddToColumn(point);
  points_ = {};
}

void Trace::AddToColumn(const Point& point) {
  const double number = std::clamp(std::floor((point.time_s - start_s_) * columns_per_s_), 0.0, last_column_);
  if (columns_.empty() || columns_.back().number != number) {
    columns_.push_back({.number = number, .least = point, .most = point, .begins = point.begins});
    return;
  }
  Column& column = columns_.back();
  if (point.value < column.least.value) column.least = point;
  if (point.value > column.most.value) column.most = point;
}

std::vector<Trace::Point> Trace::Points() const {
  if (!decimated_) return points_;
  std::vector<Point> out;
  out.reserve(2 * columns_.size());
  for (const Column& column : columns_) {
    const bool least_first = column.least.time_s <= column.most.time_s;
    Point first = least_first ? column.least : column.most;
    Point second = least_first ? column.most : column.least;
    first.begins = column.begins;
    second.begins = false;
    out.push_back(first);
    if (second.time_s != first.time_s) out.push_back(second);
  }
  return out;
}

}  // namespace taclink::command
