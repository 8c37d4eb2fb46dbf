// Every field of a LinkState comes back from the wire, but for those that the test names. The list of fields
// is that of link_state_fields.h, so that a new field fails here until the codec has it.
#include <gtest/gtest.h>

#include <map>
#include <set>
#include <sstream>

#include "sensing/core/link_state_fields.h"
#include "wire/frame_codec.h"

namespace taclink::wire {
namespace {

// What stays inside the server.
const std::set<std::string> kNotOnTheWire = {"shape.measured", "shape.rejected", "forces.loaded",
                                             "forces.region_residual"};

// Calls `visit(path, leaf)` for all values in `value`, those of structs without VisitFields as a whole.
template <typename T, typename Visitor>
void VisitLeaves(const std::string& path, T& value, const Visitor& visit) {
  if constexpr (HasFields<T>) {
    VisitFields(value, [&](const char* name, auto& member) {
      VisitLeaves(path.empty() ? name : path + "." + name, member, visit);
    });
  } else if constexpr (kIsVector<std::remove_const_t<T>>) {
    for (auto& element : value) VisitLeaves(path, element, visit);
  } else {
    visit(path, value);
  }
}

// Sets leaves to distinct values that are exact in single precision and in SI units.
struct Setter {
  int* next;
  double Number() const { return ++*next; }
  void operator()(const std::string&, bool& value) const { value = true; }
  void operator()(const std::string&, int& value) const { value = static_cast<int>(Number()); }
  void operator()(const std::string&, int64_t& value) const { value = static_cast<int64_t>(Number()); }
  void operator()(const std::string&, uint64_t& value) const { value = static_cast<uint64_t>(Number()); }
  void operator()(const std::string&, double& value) const { value = Number(); }
  void operator()(const std::string&, std::string& value) const { value = std::to_string(Number()); }
  void operator()(const std::string&, Vec3& value) const { value = Vec3(Number(), Number(), Number()); }
  void operator()(const std::string&, Mat3& value) const {
    value = Mat3::Constant(Number());
    value.diagonal() *= 2;
  }
  template <typename T>
  void operator()(const std::string& path, std::optional<T>& value) const {
    (*this)(path, value.emplace());
  }
  void operator()(const std::string&, PressureEstimate& value) const { value = {Number(), Number()}; }
  void operator()(const std::string& path, SpecificForceEstimate& value) const {
    (*this)(path, value.mps2);
    (*this)(path, value.covariance);
  }
  void operator()(const std::string& path, SpecificForceReading& value) const {
    (*this)(path, value.mps2);
    (*this)(path, value.covariance);
    value.origin = AttitudeOrigin::kClient;
    (*this)(path, value.trouble);
  }
  void operator()(const std::string& path, SimulationReport& value) const {
    auto& [contacts, trouble] = value;
    (*this)(path, trouble);
    auto& [body_id, center_mm, normal, force_n, depth_mm] = contacts.emplace_back();
    (*this)(path, body_id);
    for (Vec3* vector : {&center_mm, &normal, &force_n}) (*this)(path, *vector);
    (*this)(path, depth_mm);
  }
  void operator()(const std::string&, MeasuredDisplacement& value) const { value.displacement_mm.setOnes(); }
  void operator()(const std::string&, RejectedMarker& value) const { value.marker = 1; }
  void operator()(const std::string&, std::array<CameraCounts, kCameraCount>& cameras) const {
    for (CameraCounts& camera : cameras) {
      auto& [detections, labelled, bad_picture, contrast] = camera;
      contrast = 0.5;
      detections = static_cast<int>(Number());
      labelled = static_cast<int>(Number());
    }
  }
  void operator()(const std::string&, TrackingReport& value) const {
    auto& [mode, reason, cameras] = value;
    mode = TrackingMode::kTracked;
    reason = AcquireReason::kGap;
    for (CameraTracking& camera : cameras) {
      auto& [share_read, verified, measured, searched, found, dropped] = camera;
      share_read = 0.25;
      for (int* count : {&verified, &measured, &searched, &found, &dropped})
        *count = static_cast<int>(Number());
    }
  }
  void operator()(const std::string&, FrameTimes& value) const {
    auto& [exposure_monotonic_ns, exposure_utc_ns, received_ns, tracked_ns, solved_ns, published_ns] = value;
    for (int64_t* time_ns :
         {&exposure_monotonic_ns, &exposure_utc_ns, &received_ns, &tracked_ns, &solved_ns, &published_ns})
      *time_ns = static_cast<int64_t>(Number());
  }
  void operator()(const std::string&, StageTimes& value) const {
    auto& [decode, detect, register_, reconstruct, force] = value;
    for (double* ms : {&decode, &detect, &register_, &reconstruct, &force}) *ms = Number();
  }
  // Any that is not the default.
  void operator()(const std::string&, LinkStatus& value) const { value = LinkStatus::kDegraded; }
  void operator()(const std::string&, ReasonId& value) const { value = ReasonId::kWorker; }
  void operator()(const std::string&, PressureOrigin& value) const { value = PressureOrigin::kSerial; }
  void operator()(const std::string&, BaselineOrigin& value) const { value = BaselineOrigin::kTare; }
  void operator()(const std::string&, DriftState& value) const { value = DriftState::kHeld; }
  void operator()(const std::string&, MarkerSource& value) const { value = MarkerSource::kBottom; }
  void operator()(const std::string&, ForceModel& value) const { value = ForceModel::kNonlinear; }
};

// Turns values into text, rounded to what single precision keeps.
struct Printer {
  std::map<std::string, std::string>* out;
  static std::string Text(double value) {
    std::ostringstream text;
    text.precision(5);
    text << value;
    return text.str();
  }
  template <typename T>
  static std::string Text(const std::optional<T>& value) {
    return value ? Text(*value) : "none";
  }
  template <typename T>
    requires std::is_enum_v<T>
  static std::string Text(T value) {
    return std::to_string(static_cast<int>(value));
  }
  template <typename T>
    requires std::is_integral_v<T>
  static std::string Text(T value) {
    return std::to_string(value);
  }
  static std::string Text(const std::string& value) { return value; }
  template <int Rows, int Columns>
  static std::string Text(const Eigen::Matrix<double, Rows, Columns>& value) {
    std::string text;
    for (const double number : value.reshaped()) text += Text(number) + " ";
    return text;
  }
  static std::string Text(const PressureEstimate& value) {
    return Text(value.mpa) + " " + Text(value.sigma_mpa);
  }
  static std::string Text(const SimulationReport& value) {
    std::string text = value.trouble;
    for (const AppliedContact& contact : value.contacts)
      text += " " + Text(contact.body_id) + " " + Text(contact.center_mm) + Text(contact.normal) +
              Text(contact.force_n) + Text(contact.depth_mm);
    return text;
  }
  static std::string Text(const SpecificForceEstimate& value) {
    return Text(value.mps2) + " " + Text(value.covariance);
  }
  static std::string Text(const SpecificForceReading& value) {
    return Text(value.mps2) + " " + Text(value.covariance) + " " + Text(value.origin) + " " + value.trouble;
  }
  static std::string Text(const std::array<CameraCounts, kCameraCount>& cameras) {
    std::string text;
    for (const CameraCounts& camera : cameras)
      text += Text(camera.detections) + " " + Text(camera.labelled) + " " + Text(camera.contrast) + " ";
    return text;
  }
  static std::string Text(const TrackingReport& value) {
    std::string text = Text(value.mode) + " " + Text(value.reason);
    for (const CameraTracking& camera : value.cameras) {
      text += " " + Text(camera.share_read);
      for (const int count :
           {camera.verified, camera.measured, camera.searched, camera.found, camera.dropped})
        text += " " + Text(count);
    }
    return text;
  }
  static std::string Text(const FrameTimes& t) {
    std::string text;
    for (const int64_t time_ns : {t.exposure_monotonic_ns, t.exposure_utc_ns, t.received_ns, t.tracked_ns,
                                  t.solved_ns, t.published_ns})
      text += Text(time_ns) + " ";
    return text;
  }
  static std::string Text(const StageTimes& ms) {
    std::string text;
    for (const double time : {ms.decode, ms.detect, ms.register_, ms.reconstruct, ms.force})
      text += Text(time) + " ";
    return text;
  }
  static std::string Text(const MeasuredDisplacement&) { return "measured"; }
  static std::string Text(const RejectedMarker&) { return "rejected"; }

  template <typename T>
  void operator()(const std::string& path, const T& value) const {
    (*out)[path] += Text(value) + ";";
  }
};

std::map<std::string, std::string> Printed(const LinkState& state) {
  std::map<std::string, std::string> out;
  VisitLeaves("", state, Printer{&out});
  return out;
}

LinkState FilledState() {
  LinkState state;
  // One element in every vector, so that there are leaves to set.
  const auto one = [](const char*, auto& field) {
    if constexpr (kIsVector<std::remove_reference_t<decltype(field)>>) field.resize(1);
  };
  VisitFields(state, one);
  VisitFields(state.shape, one);
  VisitFields(state.forces, one);
  VisitFields(state.contacts[0], one);
  VisitFields(state.baseline, one);
  int next = 0;
  VisitLeaves("", state, Setter{&next});
  return state;
}

TEST(FrameFields, AllComeBackFromTheWire) {
  const LinkState state = FilledState();
  const auto decoded = DecodeFrame(EncodeFrame({"upper", 0}, state, Detail::kFull));
  ASSERT_TRUE(decoded.ok()) << decoded.error().message;
  const auto back = Printed(decoded->state);
  const auto none = Printed(LinkState());
  for (const auto& [field, text] : Printed(state)) {
    const auto found = back.find(field);
    const std::string came_back = found == back.end() ? "" : found->second;
    const auto initial = none.find(field);
    if (kNotOnTheWire.contains(field)) {
      EXPECT_NE(came_back, text) << field << " is on the wire: take it off the test's list";
      continue;
    }
    if (initial != none.end() && field != "forces.converged") {
      EXPECT_NE(initial->second, text) << field << ": the test does not set it";
    }
    EXPECT_EQ(came_back, text) << field << " does not come back: see wire/frame_codec.cpp";
  }
}

TEST(FrameFields, ClearedLikeNew) {
  LinkState state = FilledState();
  ResetField(state, LinkState());
  EXPECT_EQ(Printed(state), Printed(LinkState()));
}

}  // namespace
}  // namespace taclink::wire
