#include "server/rpc/requests/request_check.h"

#include <array>
#include <cmath>
#include <limits>
#include <set>
#include <sstream>
#include <string_view>

#include "sensing/core/name.h"

namespace taclink::server {
namespace {

using google::protobuf::FieldDescriptor;
using google::protobuf::Message;
using google::protobuf::Reflection;

constexpr double kMostRateHz = 1e6;
constexpr double kMostForceN = 1e6;
constexpr double kMostLengthM = 1e3;
constexpr double kMostPairs = 300;  // 10 s at 30 Hz
constexpr double kMostPosition = 1e6;
constexpr double kMostVacuumPa = 2e5, kMostPressurePa = 1e7;
constexpr double kMostSpecificForce = 100;  // m/s^2
constexpr double kMostHoldS = 3600;
constexpr double kMostMeasuredS = 36000, kMostTrial = 1e6;
constexpr double kMostHistoryS = 300;
constexpr double kNoLimit = std::numeric_limits<double>::infinity();

struct Bounds {
  std::string_view field;  // MESSAGE.FIELD
  double min, max;         // inclusive
  std::string_view what;
};

// Fields without an entry may have any finite number.
constexpr std::array kBounds = {
    Bounds{"StreamFramesRequest.max_rate_hz", 0, kMostRateHz, "Hz; 0: no limit"},
    Bounds{"StreamFramesRequest.deadband_force_n", 0, kMostForceN, "N; 0: none"},
    Bounds{"StreamFramesRequest.deadband_move_m", 0, kMostLengthM, "m; 0: none"},
    Bounds{"GetForceHistoryRequest.span_s", 0, kMostHistoryS, "s; 0: 60"},
    Bounds{"StreamContactsRequest.max_rate_hz", 0, kMostRateHz, "Hz; 0: no limit"},
    Bounds{"StreamPreviewRequest.max_rate_hz", 0, 30, "Hz; 0: 5"},
    Bounds{"CalibrateRequest.pairs", 0, kMostPairs, "pairs of pictures; 0: 8"},
    Bounds{"CalibrateRequest.repeats", 0, 100, "calibrations; 0: 1"},
    Bounds{"TareRequest.frames", 0, kMostPairs, "frames; 0: 10"},
    Bounds{"Thresholds.warning_n", 0, kMostForceN, "N; 0: no such level"},
    Bounds{"Thresholds.alarm_n", 0, kMostForceN, "N; 0: no such level"},
    Bounds{"Thresholds.hysteresis_n", 0, kMostForceN, "N"},
    Bounds{"SetCameraRequest.exposure_s", 1e-5, 1, "s"},
    Bounds{"ReplayRequest.from_utc_ns", 0, kNoLimit, "ns; 0: the log's first"},
    Bounds{"ReplayRequest.to_utc_ns", 0, kNoLimit, "ns; 0: the log's last"},
    Bounds{"ReplayRequest.speed", 0, 100, "times as fast; 0: as messages are taken"},
    Bounds{"ControlReplayRequest.seek_utc_ns", 0, kNoLimit, "ns"},
    Bounds{"ControlReplayRequest.speed", 0, 100, "times as fast; 0: as messages are taken"},
    Bounds{"ControlReplayRequest.step", 1, 1000, "frames"},
    Bounds{"GetReplayPicturesRequest.utc_ns", 0, kNoLimit, "ns"},
    Bounds{"UpdateJointStatesRequest.positions", -kMostPosition, kMostPosition, "rad or m"},
    Bounds{"UpdateJointStatesRequest.velocities", -kMostPosition, kMostPosition, "rad/s or m/s"},
    Bounds{"UpdateJointStatesRequest.utc_ns", 0, kNoLimit, "ns since 1970"},
    Bounds{"UpdateJointStatesRequest.monotonic_ns", 0, kNoLimit, "ns of the server's clock"},
    Bounds{"UpdatePressureRequest.pressure_pa", -kMostVacuumPa, kMostPressurePa, "Pa above the surroundings"},
    Bounds{"UpdatePressureRequest.utc_ns", 0, kNoLimit, "ns since 1970"},
    Bounds{"UpdatePressureRequest.monotonic_ns", 0, kNoLimit, "ns of the server's clock"},
    Bounds{"SetPressureRequest.pressure_pa", 0, kMostPressurePa, "Pa above the surroundings"},
    Bounds{"SetPressureRequest.ramp_pa_per_s", 0, kMostPressurePa, "Pa/s"},
    Bounds{"PressRequest.diameter_m", 0, kMostLengthM, "m; 0: 0.011"},
    Bounds{"PressRequest.angle_rad", -kMostPosition, kMostPosition, "rad"},
    Bounds{"PressRequest.z_m", 0, kMostLengthM, "m"},
    Bounds{"PressRequest.depth_m", 0, kMostLengthM, "m"},
    Bounds{"PressRequest.force_n", 0, kMostForceN, "N"},
    Bounds{"SetScenePressureRequest.pressure_pa", 0, kMostPressurePa, "Pa above the surroundings"},
    Bounds{"MoveSceneJointRequest.position_rad", -kMostPosition, kMostPosition, "rad"},
    Bounds{"PressRequest.hold_s", 0, kMostHoldS, "s; 0: until Release"},
    Bounds{"MeasureTrialRequest.trial", 0, kMostTrial, "of the acceptance"},
    Bounds{"SkipTrialRequest.trial", 0, kMostTrial, "of the acceptance"},
    Bounds{"MeasureTrialRequest.duration_s", 0, kMostMeasuredS, "s; 0: 1, or as long as a load is held"},
    Bounds{"TrialReference.force_n", 0, kMostForceN, "N"},
    Bounds{"TrialReference.force_sigma_n", 0, kMostForceN, "N"},
    Bounds{"TrialReference.pressure_pa", -kMostVacuumPa, kMostPressurePa, "Pa above the surroundings"},
    Bounds{"Vector3.x", -kMostSpecificForce, kMostSpecificForce, "m/s^2"},
    Bounds{"Vector3.y", -kMostSpecificForce, kMostSpecificForce, "m/s^2"},
    Bounds{"Vector3.z", -kMostSpecificForce, kMostSpecificForce, "m/s^2"},
    Bounds{"UpdateAttitudeRequest.sigma_mps2", 0, kMostSpecificForce, "m/s^2; 0: as configured"},
    Bounds{"UpdateAttitudeRequest.utc_ns", 0, kNoLimit, "ns since 1970"},
    Bounds{"UpdateAttitudeRequest.monotonic_ns", 0, kNoLimit, "ns of the server's clock"},
};

const Bounds* FindBounds(const FieldDescriptor& field) {
  const std::string name = field.containing_type()->name() + "." + field.name();
  for (const Bounds& bounds : kBounds) {
    if (bounds.field == name) return &bounds;
  }
  return nullptr;
}

Error Invalid(const FieldDescriptor& field, const std::string& what) {
  return {ErrorCode::kInvalidArgument, field.name() + " " + what};
}

Result<void> CheckNumber(const FieldDescriptor& field, double value) {
  const Bounds* const bounds = FindBounds(field);
  if (!std::isfinite(value)) return Invalid(field, "must be a finite number");
  if (bounds == nullptr || (value >= bounds->min && value <= bounds->max)) return {};
  std::ostringstream out;
  out << "must be " << (std::isinf(bounds->max) ? "at least " : "") << bounds->min;
  if (!std::isinf(bounds->max)) out << " to " << bounds->max;
  out << " " << bounds->what << "; not " << value;
  return Invalid(field, out.str());
}

// A name that nothing has is not found, which says more; here it is about what a text may contain.
Result<void> CheckText(const FieldDescriptor& field, const std::string& text) {
  const auto good = CheckNote(text);
  if (field.name() == "note") return good ? good : Invalid(field, good.error().message);
  if (good && text.find_first_of("\n\t") == std::string::npos) return {};
  return Invalid(field, "must be one line of UTF-8 without control characters, at most 4096 bytes");
}

Result<void> CheckEnumerator(const FieldDescriptor& field, int number) {
  if (field.enum_type()->FindValueByNumber(number) != nullptr) return {};
  return Invalid(field, std::to_string(number) + " is no " + field.enum_type()->name());
}

/// One value of a field, of a list the one at `at`.
class Value {
 public:
  Value(const Message& message, const FieldDescriptor& field, int at)
      : message_(message), field_(field), at_(at) {}

  Result<void> Check() const {
    switch (field_.cpp_type()) {
      case FieldDescriptor::CPPTYPE_DOUBLE:
        return CheckNumber(field_, Get<double>(&Reflection::GetDouble, &Reflection::GetRepeatedDouble));
      case FieldDescriptor::CPPTYPE_FLOAT:
        return CheckNumber(field_, Get<float>(&Reflection::GetFloat, &Reflection::GetRepeatedFloat));
      case FieldDescriptor::CPPTYPE_INT32:
        return CheckNumber(field_, Get<int32_t>(&Reflection::GetInt32, &Reflection::GetRepeatedInt32));
      case FieldDescriptor::CPPTYPE_INT64:
        return CheckNumber(
            field_, static_cast<double>(Get<int64_t>(&Reflection::GetInt64, &Reflection::GetRepeatedInt64)));
      case FieldDescriptor::CPPTYPE_UINT32:
        return CheckNumber(field_, Get<uint32_t>(&Reflection::GetUInt32, &Reflection::GetRepeatedUInt32));
      case FieldDescriptor::CPPTYPE_UINT64:
        return CheckNumber(field_, static_cast<double>(Get<uint64_t>(&Reflection::GetUInt64,
                                                                     &Reflection::GetRepeatedUInt64)));
      case FieldDescriptor::CPPTYPE_ENUM:
        return CheckEnumerator(field_, enumerator());
      case FieldDescriptor::CPPTYPE_STRING:
        return field_.type() == FieldDescriptor::TYPE_BYTES ? Result<void>() : CheckText(field_, text());
      case FieldDescriptor::CPPTYPE_MESSAGE:
        return CheckRequest(at_ < 0 ? reflection().GetMessage(message_, &field_)
                                    : reflection().GetRepeatedMessage(message_, &field_, at_));
      case FieldDescriptor::CPPTYPE_BOOL:
        return {};
    }
    return {};
  }

  int enumerator() const { return Get<int>(&Reflection::GetEnumValue, &Reflection::GetRepeatedEnumValue); }
  std::string text() const {
    return Get<std::string>(&Reflection::GetString, &Reflection::GetRepeatedString);
  }

 private:
  template <typename T>
  T Get(T (Reflection::*one)(const Message&, const FieldDescriptor*) const,
        T (Reflection::*of_list)(const Message&, const FieldDescriptor*, int) const) const {
    return at_ < 0 ? (reflection().*one)(message_, &field_) : (reflection().*of_list)(message_, &field_, at_);
  }
  const Reflection& reflection() const { return *message_.GetReflection(); }

  const Message& message_;
  const FieldDescriptor& field_;
  const int at_;
};

Result<void> CheckList(const Message& message, const FieldDescriptor& field) {
  const int size = message.GetReflection()->FieldSize(message, &field);
  std::set<std::string> seen;
  for (int at = 0; at < size; ++at) {
    const Value value(message, field, at);
    if (auto good = value.Check(); !good) return good;
    std::string word;
    if (field.cpp_type() == FieldDescriptor::CPPTYPE_STRING) word = value.text();
    if (field.cpp_type() == FieldDescriptor::CPPTYPE_ENUM) word = std::to_string(value.enumerator());
    const bool named = field.cpp_type() == FieldDescriptor::CPPTYPE_STRING || !word.empty();
    if (named && !seen.insert(word).second) return Invalid(field, "has '" + word + "' twice");
  }
  return {};
}

}  // namespace

Result<void> CheckRequest(const Message& request) {
  const google::protobuf::Descriptor& type = *request.GetDescriptor();
  for (int i = 0; i < type.field_count(); ++i) {
    const FieldDescriptor& field = *type.field(i);
    Result<void> good;
    if (field.is_repeated()) {
      good = CheckList(request, field);
    } else if (!field.has_presence() || request.GetReflection()->HasField(request, &field)) {
      good = Value(request, field, -1).Check();
    }
    if (!good) return good;
  }
  return {};
}

}  // namespace taclink::server
