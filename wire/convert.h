#pragma once

#include <array>
#include <utility>

#include "sensing/core/contact.h"
#include "sensing/core/link_model.h"
#include "sensing/core/link_state.h"
#include "taclink/v1/arm.pb.h"
#include "taclink/v1/frame.pb.h"
#include "wire/detail.h"

namespace taclink::wire {

// Small pieces that both frames and the arm's description are made of.

v1::Detail ToWire(Detail detail);
v1::LinkStatus ToWire(LinkStatus status);
v1::Reason ToWire(ReasonId reason);
v1::TrackingMode ToWire(TrackingMode mode);
TrackingMode FromWire(v1::TrackingMode mode);
v1::AcquireReason ToWire(AcquireReason reason);
AcquireReason FromWire(v1::AcquireReason reason);
v1::ForceModel ToWire(ForceModel model);
v1::MarkerSource ToWire(MarkerSource source);
void Fill(const Baseline& baseline, v1::Baseline& out);
Baseline FromWire(const v1::Baseline& baseline);

/// Values that this build does not know become the weakest one: kContacts, kLost, kLinear, kInferred.
Detail FromWire(v1::Detail detail);
LinkStatus FromWire(v1::LinkStatus status);
ForceModel FromWire(v1::ForceModel model);
MarkerSource FromWire(v1::MarkerSource source);

void Fill(const PressureReport& report, v1::PressureReport& out);
PressureReport FromWire(const v1::PressureReport& message);

/// The upper triangle row by row, in which all covariances are sent.
inline constexpr std::array<std::pair<int, int>, 6> kUpperTriangle = {
    {{0, 0}, {0, 1}, {0, 2}, {1, 1}, {1, 2}, {2, 2}}};

void Fill(const FrameTimes& times, v1::FrameTimes& out);
/// `scale`: of the quantity whose covariance it is.
void FillCovariance(const Mat3& covariance, double scale, google::protobuf::RepeatedField<double>& out);
void Fill(const Vec3& value, double scale, v1::Vector3& out);
Vec3 FromWire(const v1::Vector3& value, double scale);

void Fill(const Rigid3& base_from_link, v1::Pose& out);
void Fill(const LinkModel& model, v1::LinkModel& out);

}  // namespace taclink::wire
