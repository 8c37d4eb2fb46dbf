#pragma once

#include <google/protobuf/descriptor.h>
#include <google/protobuf/generated_enum_reflection.h>
#include <google/protobuf/repeated_field.h>

#include <array>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "taclink/v1/events.pb.h"
#include "taclink/v1/frame.pb.h"
#include "taclink/v1/geometry.pb.h"

/// Values that the messages of taclink.v1 hold in another form than programs compute with. All functions may
/// be called from any thread.
namespace taclink::client {

using Vector3 = std::array<double, 3>;
/// Symmetric: xx, xy, xz, yy, yz, zz.
using Covariance3 = std::array<double, 6>;

Vector3 ToArray(const v1::Vector3& vector);
/// Euclidean norm, in the unit of the vector.
double Norm(const v1::Vector3& vector);
/// How strongly a contact acts on the skin, N: normal_force_n or |force_n|, the larger one (see v1::Contact).
double MagnitudeN(const v1::Contact& contact);
double MagnitudeN(const v1::ContactEvent& contact);
/// Sum over the contacts, N; NaN: the forces are not known.
double TotalMagnitudeN(const v1::LinkFrame& frame);
/// Groups of three numbers, such as LinkFrame.positions_m, as one point each. Fewer than three numbers at the
/// end are ignored.
std::vector<Vector3> Points(const google::protobuf::RepeatedField<float>& numbers);
/// A covariance field, such as Contact.force_covariance_n2. None: the field is empty, so the covariance is
/// not known.
std::optional<Covariance3> Covariance(const google::protobuf::RepeatedField<double>& numbers);
/// Standard deviations of the three components.
Vector3 Sigmas(const Covariance3& covariance);

/// Time from the exposure of the frame to now, s, by the clock of this machine: call it right after
/// FrameReader::Next. It is as accurate as both machines' clocks agree. None: the frame has no exposure, or
/// it comes from a log.
std::optional<double> LatencyS(const v1::LinkFrame& frame);
/// The same for the frame that caused an event; call it right after EventReader::Next. None: no frame caused
/// the event, or it comes from a log.
std::optional<double> LatencyS(const v1::Event& event);

// The functions behind the templates below.
const char* EnumName(const google::protobuf::EnumDescriptor& type, int number);
std::optional<int> EnumNumber(const google::protobuf::EnumDescriptor& type, std::string_view name);
std::vector<std::string> EnumNames(const google::protobuf::EnumDescriptor& type);

/// The name of a value in lower case and without the prefix of its enum: LINK_STATUS_OK is "ok". Number 0
/// (..._UNSPECIFIED) is "unknown", or "unspecified" in an enum with an UNKNOWN of its own; numbers that this
/// version does not have are "unknown". The text lasts as long as the
/// program.
template <typename Enum>
  requires google::protobuf::is_proto_enum<Enum>::value
const char* Name(Enum value) {
  return EnumName(*google::protobuf::GetEnumDescriptor<Enum>(), static_cast<int>(value));
}

/// The value with that name. None: no value but number 0 has that name.
template <typename Enum>
  requires google::protobuf::is_proto_enum<Enum>::value
std::optional<Enum> ValueOf(std::string_view name) {
  const auto number = EnumNumber(*google::protobuf::GetEnumDescriptor<Enum>(), name);
  return number ? std::optional(static_cast<Enum>(*number)) : std::nullopt;
}

/// The names of all values except number 0, in the order of the .proto file.
template <typename Enum>
  requires google::protobuf::is_proto_enum<Enum>::value
std::vector<std::string> Names() {
  return EnumNames(*google::protobuf::GetEnumDescriptor<Enum>());
}

}  // namespace taclink::client
