#include "wire/frame_codec.h"

#include <gtest/gtest.h>

#include <random>

#include "taclink/v1/tactile.pb.h"

namespace taclink::wire {
namespace {

Vec3 Random3(std::mt19937& random, double size) {
  std::uniform_real_distribution<double> d(-size, size);
  return {d(random), d(random), d(random)};
}

LinkState MakeState(int markers) {
  std::mt19937 random(7);
  LinkState state;
  state.sequence = 12345678901;
  state.times = {.exposure_monotonic_ns = 11,
                 .exposure_utc_ns = 1700000000123456789,
                 .received_ns = 12,
                 .tracked_ns = 13,
                 .solved_ns = 14,
                 .published_ns = 15};
  state.status = LinkStatus::kDegraded;
  state.status_reason = "bottom camera lost; check its cable";
  state.reasons = {{ReasonId::kCamera, state.status_reason},
                   {ReasonId::kPressureMismatch, "the sensor", 0.0003, 0.00015},
                   {ReasonId::kTooDeep, "press less", 17, 16},
                   {ReasonId::kLate, "late", 0.25}};
  state.pressure_mpa = 0.002;
  state.pressure = {.origin = PressureOrigin::kSerial,
                    .stale = true,
                    .mpa = 0.002,
                    .age_ns = 1'500'000'000,
                    .trouble = "unplugged"};
  state.cameras = {{{240, 230}, {239, 228}}};
  state.tracking = {.mode = TrackingMode::kTracked,
                    .reason = AcquireReason::kLoss,
                    .cameras = {{{0.25, 1, 2, 3, 4, 5}, {0.5, 6, 7, 8, 9, 10}}}};
  for (int i = 0; i < markers; ++i) {
    state.shape.positions_mm.push_back(Random3(random, 100));
    state.shape.displacements_mm.push_back(Random3(random, 5));
    const Mat3 root = Mat3::Random() * 0.05;
    state.shape.covariances_mm2.push_back(root * root.transpose());
    state.shape.sources.push_back(static_cast<MarkerSource>(i % 4));
    state.forces.forces_n.push_back(Random3(random, 1));
    state.forces.sigmas_n.push_back(0.01 * i);
    state.forces.limits_n.push_back(0.03 + 0.01 * (i % 5));
  }
  state.forces.residual = 1.25;
  state.forces.camera_shift_mm = 0.4;
  state.forces.limit_around_n = 0.3;
  state.forces.converged = true;
  Contact contact;
  contact.id = 42;
  contact.center_mm = Vec3(36.5, 0, 90);
  contact.normal = Vec3(1, 0, 0);
  contact.force_n = Vec3(-0.2, 0.01, 0);
  contact.force_covariance_n2 = Mat3{{1, 2, 3}, {2, 4, 5}, {3, 5, 6}};
  contact.center_covariance_mm2 = Mat3{{0.5, 0.1, 0}, {0.1, 0.25, 0}, {0, 0, 2}};
  contact.normal_force_n = 0.2;
  contact.area_mm2 = 150;
  contact.markers = {3, 4};
  state.contacts = {contact, Contact{}};
  state.total_force_n = contact.force_n;
  state.baseline_age_s = 61.5;
  state.baseline = {.origin = BaselineOrigin::kForcedTare,
                    .taken_utc_ns = 1700000000000000001,
                    .drift_mm = 0.25,
                    .drift_state = DriftState::kHeld};
  state.stage_ms = {.decode = 1, .detect = 2, .register_ = 3, .reconstruct = 4, .force = 5};
  return state;
}

const LinkId kLink{"upper_arm", 3};

void ExpectNear(const std::vector<Vec3>& a, const std::vector<Vec3>& b, double tolerance) {
  ASSERT_EQ(a.size(), b.size());
  for (size_t i = 0; i < a.size(); ++i) EXPECT_NEAR((a[i] - b[i]).norm(), 0, tolerance);
}

TEST(FrameCodec, FullComesBack) {
  const LinkState state = MakeState(8);
  const auto decoded = DecodeFrame(EncodeFrame(kLink, state, Detail::kFull));
  ASSERT_TRUE(decoded.ok()) << decoded.error().message;
  EXPECT_EQ(decoded->link.name, kLink.name);
  EXPECT_EQ(decoded->link.index, kLink.index);
  EXPECT_EQ(decoded->detail, Detail::kFull);
  const LinkState& back = decoded->state;
  EXPECT_EQ(back.sequence, state.sequence);
  EXPECT_EQ(back.times.exposure_utc_ns, state.times.exposure_utc_ns);
  EXPECT_EQ(back.times.exposure_monotonic_ns, state.times.exposure_monotonic_ns);
  EXPECT_EQ(back.times.received_ns, state.times.received_ns);
  EXPECT_EQ(back.times.tracked_ns, state.times.tracked_ns);
  EXPECT_EQ(back.times.solved_ns, state.times.solved_ns);
  EXPECT_EQ(back.times.published_ns, state.times.published_ns);
  EXPECT_EQ(back.status, state.status);
  EXPECT_EQ(back.status_reason, state.status_reason);
  EXPECT_DOUBLE_EQ(back.pressure_mpa.value(), 0.002);
  EXPECT_EQ(back.baseline.origin, BaselineOrigin::kForcedTare);
  EXPECT_EQ(back.baseline.taken_utc_ns, state.baseline.taken_utc_ns);
  EXPECT_DOUBLE_EQ(back.baseline.drift_mm, 0.25);
  EXPECT_EQ(back.baseline.drift_state, DriftState::kHeld);
  EXPECT_EQ(back.pressure.origin, PressureOrigin::kSerial);
  EXPECT_TRUE(back.pressure.stale);
  EXPECT_DOUBLE_EQ(back.pressure.mpa, 0.002);
  EXPECT_EQ(back.pressure.age_ns, 1'500'000'000);
  EXPECT_EQ(back.pressure.trouble, "unplugged");
  EXPECT_EQ(back.cameras[1].labelled, 228);
  EXPECT_EQ(back.tracking.mode, TrackingMode::kTracked);
  EXPECT_EQ(back.tracking.reason, AcquireReason::kLoss);
  EXPECT_EQ(back.tracking.cameras[0].share_read, 0.25);
  EXPECT_EQ(back.tracking.cameras[0].dropped, 5);
  EXPECT_EQ(back.tracking.cameras[1].verified, 6);
  EXPECT_EQ(back.tracking.cameras[1].measured, 7);
  EXPECT_EQ(back.tracking.cameras[1].searched, 8);
  EXPECT_EQ(back.tracking.cameras[1].found, 9);
  ExpectNear(back.shape.positions_mm, state.shape.positions_mm, 1e-4);
  ExpectNear(back.shape.displacements_mm, state.shape.displacements_mm, 1e-5);
  ExpectNear(back.forces.forces_n, state.forces.forces_n, 1e-6);
  ASSERT_EQ(back.shape.covariances_mm2.size(), 8u);
  for (size_t i = 0; i < 8; ++i) {
    EXPECT_NEAR((back.shape.covariances_mm2[i] - state.shape.covariances_mm2[i]).norm(), 0, 1e-7);
    EXPECT_NEAR(back.forces.sigmas_n[i], state.forces.sigmas_n[i], 1e-7);
    EXPECT_NEAR(back.forces.limits_n[i], state.forces.limits_n[i], 1e-7);
  }
  EXPECT_EQ(back.shape.sources, state.shape.sources);
  EXPECT_EQ(back.forces.residual, 1.25);
  EXPECT_NEAR(back.forces.camera_shift_mm, 0.4, 1e-9);
  EXPECT_EQ(back.forces.limit_around_n, 0.3);
  EXPECT_TRUE(back.forces.converged);
  ASSERT_EQ(back.contacts.size(), 2u);
  EXPECT_EQ(back.contacts[0].id, 42u);
  EXPECT_NEAR((back.contacts[0].center_mm - state.contacts[0].center_mm).norm(), 0, 1e-12);
  EXPECT_EQ(back.contacts[0].force_covariance_n2.value(), state.contacts[0].force_covariance_n2.value());
  EXPECT_NEAR(
      (back.contacts[0].center_covariance_mm2.value() - *state.contacts[0].center_covariance_mm2).norm(), 0,
      1e-12);
  EXPECT_NEAR(back.contacts[0].area_mm2, 150, 1e-9);
  EXPECT_EQ(back.contacts[0].markers, state.contacts[0].markers);
  EXPECT_FALSE(back.contacts[1].force_covariance_n2.has_value());
  EXPECT_NEAR(back.stage_ms.register_, 3, 1e-12);
  EXPECT_EQ(back.baseline_age_s, 61.5);
}

// At every level, in SI units.
TEST(FrameCodec, ReasonsHaveNumbers) {
  const LinkState state = MakeState(8);
  for (const Detail detail : {Detail::kContacts, Detail::kFull}) {
    v1::LinkFrame frame;
    Fill(kLink, state, detail, frame);
    ASSERT_EQ(frame.status_reasons_size(), 4);
    EXPECT_EQ(frame.status_reasons(0).reason(), v1::REASON_CAMERA);
    EXPECT_FALSE(frame.status_reasons(0).has_value() || frame.status_reasons(0).has_limit());
    EXPECT_EQ(frame.status_reasons(1).reason(), v1::REASON_PRESSURE_MISMATCH);
    EXPECT_EQ(frame.status_reasons(1).id(), "pressure_mismatch");
    EXPECT_NEAR(frame.status_reasons(1).value(), 300, 1e-9);
    EXPECT_NEAR(frame.status_reasons(1).limit(), 150, 1e-9);
    EXPECT_EQ(frame.status_reasons(1).unit(), "Pa");
    EXPECT_NEAR(frame.status_reasons(2).value(), 0.017, 1e-12);
    EXPECT_EQ(frame.status_reasons(2).unit(), "m");
    EXPECT_EQ(frame.status_reasons(3).value(), 0.25);
    EXPECT_FALSE(frame.status_reasons(3).has_limit());
    EXPECT_EQ(frame.status_reasons(3).unit(), "s");
    EXPECT_NEAR(frame.detection_limit_n(), 0.07, 1e-9);
    EXPECT_EQ(frame.force_residual(), 1.25);
    EXPECT_NEAR(frame.camera_shift_m(), 4e-4, 1e-12);
    EXPECT_EQ(frame.detection_limit_around_n(), 0.3);
    const LinkState back = FromWire(frame)->state;
    ASSERT_EQ(back.reasons.size(), 4u);
    EXPECT_NEAR(back.reasons[2].limit.value(), 16, 1e-9);
    EXPECT_FALSE(back.reasons[0].value);
  }
}

TEST(FrameCodec, EveryReasonHasItsNumberOnTheWire) {
  LinkState state = MakeState(0);
  state.reasons.clear();
  for (int i = 0; i < kReasonCount; ++i) state.reasons.push_back({static_cast<ReasonId>(i), "text"});
  v1::LinkFrame frame;
  Fill(kLink, state, Detail::kContacts, frame);
  ASSERT_EQ(frame.status_reasons_size(), kReasonCount);
  for (const v1::StatusReason& reason : frame.status_reasons()) {
    std::string name = v1::Reason_Name(reason.reason()).substr(std::string("REASON_").size());
    for (char& c : name) c = static_cast<char>(std::tolower(c));
    EXPECT_EQ(reason.id(), name);
  }
}

// Zeros would say that nothing presses.
TEST(FrameCodec, ForcesThatCannotBeTrustedAreNotThere) {
  LinkState state = MakeState(8);
  state.forces.converged = false;
  for (const Detail detail : {Detail::kContacts, Detail::kFull}) {
    v1::LinkFrame frame;
    Fill(kLink, state, detail, frame);
    EXPECT_FALSE(frame.has_total_force_n());
    EXPECT_EQ(frame.nodal_forces_n_size(), 0);
    EXPECT_FALSE(frame.has_detection_limit_n());
    EXPECT_FALSE(frame.has_detection_limit_around_n());
    EXPECT_FALSE(frame.has_camera_shift_m());
    EXPECT_EQ(frame.detection_limits_n_size(), 0);
    EXPECT_FALSE(FromWire(frame)->state.forces.converged);
  }
}

TEST(FrameCodec, WireIsInSi) {
  v1::LinkFrame frame;
  const LinkState state = MakeState(2);
  Fill(kLink, state, Detail::kFull, frame);
  EXPECT_NEAR(frame.contacts(0).center_m().x(), 0.0365, 1e-12);
  EXPECT_NEAR(frame.contacts(0).area_m2(), 150e-6, 1e-15);
  EXPECT_NEAR(frame.pressure_pa(), 2000, 1e-9);
  EXPECT_NEAR(frame.stage_times().force_s(), 0.005, 1e-12);
  EXPECT_NEAR(frame.positions_m(4), state.shape.positions_mm[1].y() / 1000, 1e-8);
  EXPECT_NEAR(frame.displacement_covariances_m2(7), state.shape.covariances_mm2[1](0, 1) * 1e-6, 1e-12);
  EXPECT_EQ(frame.markers_seen(), 2u);
}

TEST(FrameCodec, EachLevelHoldsTheOneBefore) {
  LinkState state = MakeState(240);
  state.reasons.clear();
  const auto contacts = EncodeFrame(kLink, state, Detail::kContacts);
  const auto geometry = EncodeFrame(kLink, state, Detail::kGeometry);
  const auto full = EncodeFrame(kLink, state, Detail::kFull);
  EXPECT_LT(contacts.size(), 550u);
  EXPECT_LT(geometry.size(), contacts.size() + 240 * 12 + 10);
  EXPECT_GT(full.size(), geometry.size());
  const auto decoded = DecodeFrame(contacts);
  ASSERT_TRUE(decoded.ok());
  EXPECT_EQ(decoded->state.contacts.size(), 2u);
  EXPECT_TRUE(decoded->state.shape.positions_mm.empty());
  const auto shape = DecodeFrame(geometry);
  ASSERT_TRUE(shape.ok());
  EXPECT_EQ(shape->state.shape.positions_mm.size(), 240u);
  EXPECT_TRUE(shape->state.shape.displacements_mm.empty());
}

TEST(FrameCodec, PrefixMakesAResponse) {
  for (const int markers : {0, 1, 240}) {
    const auto frame = EncodeFrame(kLink, MakeState(markers), Detail::kFull);
    v1::StreamFramesResponse response;
    ASSERT_TRUE(response.ParseFromString(FrameResponsePrefix(frame.size()) + frame));
    EXPECT_EQ(response.frame().link(), kLink.name);
    EXPECT_EQ(response.frame().SerializeAsString(), frame);
  }
}

TEST(FrameCodec, BadBytesAreRefused) {
  EXPECT_FALSE(DecodeFrame("\x0a\xff").ok());
  v1::LinkFrame frame;
  Fill(kLink, MakeState(4), Detail::kFull, frame);
  frame.add_positions_m(1);
  const auto odd = FromWire(frame);
  ASSERT_FALSE(odd.ok());
  EXPECT_EQ(odd.error().code, ErrorCode::kInvalidArgument);
  Fill(kLink, MakeState(4), Detail::kFull, frame);
  frame.add_displacements_m(1);
  EXPECT_FALSE(FromWire(frame).ok());
}

TEST(FrameCodec, TheMarkTellsThatNothingChanged) {
  v1::LinkFrame frame;
  ASSERT_TRUE(frame.ParseFromString(EncodeFrame({"a", 1}, LinkState{}, Detail::kContacts)));
  EXPECT_FALSE(frame.unchanged());
  ASSERT_TRUE(frame.ParseFromString(EncodeFrame({"a", 1}, LinkState{}, Detail::kContacts) + UnchangedMark()));
  EXPECT_TRUE(frame.unchanged());
  EXPECT_EQ(frame.link(), "a");
}

}  // namespace
}  // namespace taclink::wire
