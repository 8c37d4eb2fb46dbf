#pragma once

#include <chrono>
#include <memory>

#include "taclink/result.h"
#include "taclink/v1/contacts.pb.h"
#include "taclink/v1/joints.pb.h"

namespace taclink::client {

/// A running stream of the arm's contacts; it ends when destroyed. Call Next from one thread, Cancel from
/// any.
class ContactReader {
 public:
  ~ContactReader();
  ContactReader(const ContactReader&) = delete;
  ContactReader& operator=(const ContactReader&) = delete;

  /// Waits for the next message: the contacts of all links and the joint torques that they cause. Errors:
  /// kTimeout (call again), kEndOfData (cancelled), kUnavailable.
  Result<v1::StreamContactsResponse> Next(std::chrono::milliseconds timeout);
  /// Next returns kEndOfData, also one that waits now.
  void Cancel();

 private:
  friend class Client;
  struct Call;
  explicit ContactReader(std::unique_ptr<Call> call);

  std::unique_ptr<Call> call_;
};

/// Sends the positions of the arm's joints to the server. Use it from one thread.
class JointStateWriter {
 public:
  ~JointStateWriter();
  JointStateWriter(const JointStateWriter&) = delete;
  JointStateWriter& operator=(const JointStateWriter&) = delete;

  /// Waits while the server is behind. Errors: why the server ended the call (kInvalidArgument: which message
  /// and what is wrong). Nothing more can be written after an error.
  Result<void> Write(const v1::UpdateJointStatesRequest& states);
  /// Ends the call and returns how many messages the server accepted. Errors: those of Write.
  Result<v1::UpdateJointStatesResponse> Finish();

 private:
  friend class Client;
  struct Call;
  explicit JointStateWriter(std::unique_ptr<Call> call);

  std::unique_ptr<Call> call_;
};

using ArmContact [[deprecated("use taclink::v1::ArmContact")]] = v1::ArmContact;
using ArmContacts [[deprecated("use taclink::v1::StreamContactsResponse")]] = v1::StreamContactsResponse;
using LinkContacts [[deprecated("use taclink::v1::LinkContactsStatus")]] = v1::LinkContactsStatus;
using PoseValidity [[deprecated("use taclink::v1::PoseValidity")]] = v1::PoseValidity;

}  // namespace taclink::client
