#pragma once

#include <chrono>
#include <functional>
#include <memory>
#include <string>

#include "taclink/events.h"
#include "taclink/result.h"
#include "taclink/v1/arm.pb.h"
#include "taclink/v1/frame.pb.h"
#include "taclink/v1/pressure.pb.h"
#include "taclink/v1/simulation.pb.h"
#include "taclink/v1/tactile.pb.h"
#include "taclink/v1/tare.pb.h"
#include "taclink/values.h"

/// Client of a TacLINK server. Methods take and return the messages of the API (taclink/v1/*.pb.h), whose
/// fields, units and frames the .proto files document: SI units (m, N, Pa, s, rad); vectors of a link are in
/// the link frame.
namespace taclink::client {

/// Called with the pairs taken so far. Returns whether to continue; false cancels the calibration.
using CalibrateProgress = std::function<bool(const v1::CalibrationProgress& progress)>;

/// A running stream of frames; it ends when destroyed. Call Next and status from one thread, Cancel from any.
class FrameReader {
 public:
  ~FrameReader();
  FrameReader(const FrameReader&) = delete;
  FrameReader& operator=(const FrameReader&) = delete;

  /// From now on Next leaves frames out whose LatencyS is larger when they arrive, and counts them; 0: any
  /// age, as at first. It is as right as the clocks of both machines agree: synchronize them much closer than
  /// `max_age`. Frames of a log have no age.
  void SetMaxAge(std::chrono::nanoseconds max_age);
  /// Frames that were left out because of their age.
  uint64_t frames_too_old() const;

  /// Waits for the next frame. Errors: kTimeout (call again), kEndOfData (cancelled), kUnavailable (the
  /// server ended the stream or is gone, with the reason), or the reason for which the server refused the
  /// request.
  Result<v1::LinkFrame> Next(std::chrono::milliseconds timeout);

  /// Next returns kEndOfData, also one that waits now.
  void Cancel();

  /// The newest status of the server, with the counts of each link; it comes at most once a second, when
  /// frames were dropped.
  const v1::StreamStatus& status() const;

 private:
  friend class Client;
  struct Call;
  explicit FrameReader(std::unique_ptr<Call> call);

  std::unique_ptr<Call> call_;
};

/// How a client verifies the server and identifies itself. Files are PEM; empty: not used.
struct Credentials {
  std::string ca_file = {};  ///< the server's certificate must be signed by one of these; empty: no TLS
  std::string certificate_file = {};  ///< this client's own, for servers that ask for one
  std::string key_file = {};          ///< of that certificate
  std::string token = {};             ///< sent with every call; never in the clear to another machine
};

/// The default time limit of a call: the larger of `usual` and the seconds in the environment variable
/// TACLINK_PATIENCE_S, for slow machines. If the variable is not a positive number, it is `usual`;
/// Client::Connect has then reported the error.
std::chrono::milliseconds Patience(std::chrono::milliseconds usual);

class Acceptances;       // taclink/acceptance.h
class Recordings;        // taclink/recordings.h
class ContactReader;     // taclink/arm_contacts.h
class JointStateWriter;  // likewise

/// A connection to one server.
class Client {
 public:
  /// Waits 3 s for a server, and as long as Patience says for one that accepts the connection but is slow.
  /// Errors: kUnavailable (no server there, with what to do), kNotFound (a file), kInvalidArgument
  /// (credentials that can't be used so, or a TACLINK_PATIENCE_S that is not a positive number).
  static Result<Client> Connect(const std::string& address, const Credentials& credentials = {});
  /// As above, but waits for `timeout` in either case.
  static Result<Client> Connect(const std::string& address, std::chrono::milliseconds timeout,
                                const Credentials& credentials = {});
  ~Client();
  Client(Client&&) noexcept;
  Client& operator=(Client&&) noexcept;

  /// The links, their models, poses and current state. Errors: kUnavailable, kTimeout.
  Result<v1::Arm> GetArm(std::chrono::milliseconds timeout = Patience(std::chrono::seconds(10)));

  /// How strongly links were pressed in the last minutes. Errors: kNotFound (no such link), kInvalidArgument.
  Result<v1::GetForceHistoryResponse> GetForceHistory(
      const v1::GetForceHistoryRequest& request,
      std::chrono::milliseconds timeout = Patience(std::chrono::seconds(10)));

  /// Returns once the server has accepted. Errors: kNotFound (no such link), kInvalidArgument,
  /// kResourceExhausted, kUnavailable.
  Result<std::unique_ptr<FrameReader>> StreamFrames(
      const v1::StreamFramesRequest& request,
      std::chrono::milliseconds timeout = Patience(std::chrono::seconds(10)));

  /// Gives the link a fresh source and processor, as after the server's start. Returns when the server has
  /// accepted the order; GetArm shows its progress. Errors: kNotFound, kUnavailable.
  Result<void> RestartLink(const std::string& link,
                           std::chrono::milliseconds timeout = Patience(std::chrono::seconds(10)));

  /// Handles a simulated link: presses a body on it (and moves one that is there), takes bodies off (0: all),
  /// sets the pressure inside its skin, moves the joint of its scene; see simulation.proto. Frames then tell
  /// what is true (LinkFrame.simulation). Errors: kNotFound, kInvalidArgument (what is possible is in the
  /// message), kFailedPrecondition (the link is not simulated).
  Result<void> Press(const v1::PressRequest& request,
                     std::chrono::milliseconds timeout = Patience(std::chrono::seconds(10)));
  Result<void> Release(const std::string& link, uint64_t body_id = 0,
                       std::chrono::milliseconds timeout = Patience(std::chrono::seconds(10)));
  Result<void> SetScenePressure(const v1::SetScenePressureRequest& request,
                                std::chrono::milliseconds timeout = Patience(std::chrono::seconds(10)));
  Result<void> MoveSceneJoint(const v1::MoveSceneJointRequest& request,
                              std::chrono::milliseconds timeout = Patience(std::chrono::seconds(10)));

  /// Sets the pressure inside a skin that a regulator inflates, or vents it; returns its state after that, at
  /// once. Errors: kNotFound, kInvalidArgument (outside the limits), kFailedPrecondition (no regulator; it
  /// has tripped; no reading).
  Result<v1::PressureRegulator> SetPressure(
      const v1::SetPressureRequest& request,
      std::chrono::milliseconds timeout = Patience(std::chrono::seconds(10)));
  /// Errors: kNotFound, kFailedPrecondition (no regulator).
  Result<v1::PressureRegulator> GetPressure(
      const std::string& link, std::chrono::milliseconds timeout = Patience(std::chrono::seconds(10)));

  /// Sets exposure and gain; absent fields stay as they are. The settings hold until the server ends. Errors:
  /// kNotFound, kInvalidArgument (with the range of the camera), kUnsupported (nothing to set), kUnavailable
  /// (the camera is not connected).
  Result<void> SetCamera(const v1::SetCameraRequest& request,
                         std::chrono::milliseconds timeout = Patience(std::chrono::seconds(20)));
  /// Computes the link's forces by `model` from the next frame on. Errors: kNotFound, kInvalidArgument,
  /// kFailedPrecondition (LINEAR on a skin that may be inflated), kUnavailable.
  Result<void> SetForceModel(const std::string& link, v1::ForceModel model,
                             std::chrono::milliseconds timeout = Patience(std::chrono::seconds(60)));

  /// Finds the link's cameras and rest shape again; nothing may touch the skin. Waits for the end. Errors:
  /// kNotFound, kFailedPrecondition (touched, moved, does not fit: the message says), kUnavailable,
  /// kEndOfData (cancelled); then the link stays as it was.
  Result<v1::CalibrationResult> Calibrate(
      const v1::CalibrateRequest& request, const CalibrateProgress& progress = {},
      std::chrono::milliseconds timeout = Patience(std::chrono::seconds(60)));

  /// The server's recordings; see taclink/recordings.h.
  Recordings RecordingCalls() const;

  /// Acceptances of the server's links; see taclink/acceptance.h.
  Acceptances AcceptanceCalls() const;

  /// All contacts of the arm in its base frame. `max_rate_hz` 0: whenever a link publishes. Returns once the
  /// server has accepted. Errors: kInvalidArgument, kResourceExhausted, kUnavailable.
  Result<std::unique_ptr<ContactReader>> StreamContacts(
      double max_rate_hz = 0, std::chrono::milliseconds timeout = Patience(std::chrono::seconds(10)));

  /// Opens a call that sends joint states. Its writer reports what the server refuses.
  std::unique_ptr<JointStateWriter> UpdateJointStates();

  /// Sets the current state of the links as their baseline; the answer says for each link whether it was
  /// accepted. Errors: kNotFound, kInvalidArgument, kUnavailable.
  Result<v1::TareResponse> Tare(const v1::TareRequest& request,
                                std::chrono::milliseconds timeout = Patience(std::chrono::seconds(60)));

  /// Returns the new state of that region. `region` empty: the whole link. Errors: kNotFound (no such link or
  /// region), kInvalidArgument.
  Result<v1::ForceLevelState> SetThresholds(
      const std::string& link, const std::string& region, const v1::Thresholds& thresholds,
      std::chrono::milliseconds timeout = Patience(std::chrono::seconds(10)));

  /// Returns once the server has accepted. Errors: as StreamFrames.
  Result<std::unique_ptr<EventReader>> StreamEvents(
      const v1::StreamEventsRequest& request,
      std::chrono::milliseconds timeout = Patience(std::chrono::seconds(10)));

 private:
  friend class JointStateWriter;
  struct Connection;
  explicit Client(std::shared_ptr<Connection> connection);

  std::shared_ptr<Connection> connection_;
};

// Names of version 0.1, whose types had the fields of these messages. They will be removed in the next
// release.
using Arm [[deprecated("use taclink::v1::Arm")]] = v1::Arm;
using Camera [[deprecated("use taclink::v1::Camera")]] = v1::Camera;
using Contact [[deprecated("use taclink::v1::Contact")]] = v1::Contact;
using Detail [[deprecated("use taclink::v1::Detail")]] = v1::Detail;
using Delivery [[deprecated("use taclink::v1::Delivery")]] = v1::Delivery;
using ForceModel [[deprecated("use taclink::v1::ForceModel")]] = v1::ForceModel;
using Frame [[deprecated("use taclink::v1::LinkFrame")]] = v1::LinkFrame;
using Link [[deprecated("use taclink::v1::Link")]] = v1::Link;
using LinkModel [[deprecated("use taclink::v1::LinkModel")]] = v1::LinkModel;
using LinkStatus [[deprecated("use taclink::v1::LinkStatus")]] = v1::LinkStatus;
using LinkTare [[deprecated("use taclink::v1::LinkTare")]] = v1::LinkTare;

}  // namespace taclink::client
