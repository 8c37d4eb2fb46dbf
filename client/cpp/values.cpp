#include "client/cpp/taclink/values.h"

#include <algorithm>
#include <chrono>
#include <cmath>

#include "wire/enum_names.h"
#include "wire/magnitude.h"

namespace taclink::client {
namespace {

std::optional<double> SecondsSince(int64_t utc_ns) {
  if (utc_ns == 0) return std::nullopt;
  const std::chrono::nanoseconds now = std::chrono::system_clock::now().time_since_epoch();
  return static_cast<double>(now.count() - utc_ns) * 1e-9;
}

}  // namespace

Vector3 ToArray(const v1::Vector3& vector) {
  return {vector.x(), vector.y(), vector.z()};
}

double Norm(const v1::Vector3& vector) {
  return std::hypot(vector.x(), vector.y(), vector.z());
}

double MagnitudeN(const v1::Contact& contact) {
  return wire::MagnitudeN(contact);
}

double MagnitudeN(const v1::ContactEvent& contact) {
  return wire::MagnitudeN(contact);
}

double TotalMagnitudeN(const v1::LinkFrame& frame) {
  return wire::TotalMagnitudeN(frame);
}

std::vector<Vector3> Points(const google::protobuf::RepeatedField<float>& numbers) {
  std::vector<Vector3> points(static_cast<size_t>(numbers.size()) / 3);
  auto next = numbers.begin();
  for (Vector3& point : points) {
    for (double& component : point) component = static_cast<double>(*next++);
  }
  return points;
}

std::optional<Covariance3> Covariance(const google::protobuf::RepeatedField<double>& numbers) {
  Covariance3 covariance{};
  if (static_cast<size_t>(numbers.size()) != covariance.size()) return std::nullopt;
  std::copy(numbers.begin(), numbers.end(), covariance.begin());
  return covariance;
}

Vector3 Sigmas(const Covariance3& covariance) {
  const auto root = [](double variance) { return std::sqrt(std::max(0.0, variance)); };
  return {root(covariance[0]), root(covariance[3]), root(covariance[5])};
}

std::optional<double> LatencyS(const v1::LinkFrame& frame) {
  return frame.replayed() ? std::nullopt : SecondsSince(frame.times().exposure_utc_ns());
}

// The server sets sent_utc_ns when it sends an event live; logs do not have it.
std::optional<double> LatencyS(const v1::Event& event) {
  return event.times().sent_utc_ns() == 0 ? std::nullopt : SecondsSince(event.times().exposure_utc_ns());
}

const char* EnumName(const google::protobuf::EnumDescriptor& type, int number) {
  return wire::NamesOf(type).Name(number);
}

std::optional<int> EnumNumber(const google::protobuf::EnumDescriptor& type, std::string_view name) {
  return wire::NamesOf(type).Number(name);
}

std::vector<std::string> EnumNames(const google::protobuf::EnumDescriptor& type) {
  return wire::NamesOf(type).All();
}

}  // namespace taclink::client
