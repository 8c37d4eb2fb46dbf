#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <string_view>

#include "sensing/core/camera_model.h"

/// What a log of the arm holds and how it is laid out; docs/log-format.md.
namespace taclink::wire::log {

enum class TopicKind : uint8_t {
  kFrame,       ///< taclink.v1.LinkFrame, at full detail
  kPicture,     ///< foxglove.CompressedImage or foxglove.RawImage, of one camera
  kScene,       ///< foxglove.SceneUpdate
  kArm,         ///< taclink.v1.Arm
  kContacts,    ///< taclink.v1.StreamContactsResponse
  kEvents,      ///< taclink.v1.Event
  kJoints,      ///< taclink.v1.JointSample
  kLosses,      ///< taclink.v1.RecordingLoss
  kTransforms,  ///< foxglove.FrameTransform
};

struct Topic {
  TopicKind kind = TopicKind::kArm;
  std::string link = {};             ///< of kFrame, kPicture, kScene
  CameraId camera = CameraId::kTop;  ///< of kPicture

  bool operator==(const Topic&) const = default;
};

std::string ToText(const Topic& topic);
/// None: not one of these.
std::optional<Topic> ParseTopic(std::string_view text);

/// Frames of reference that Foxglove's messages name.
std::string LinkFrameId(std::string_view link);
std::string CameraFrameId(std::string_view link, CameraId camera);
inline constexpr const char* kBaseFrameId = "base";

// Names of records.
inline constexpr const char* kMetadataName = "taclink";
inline constexpr const char* kTotalsName = "taclink.totals";  ///< at the end of a closed log
/// An attachment of a closed log, a taclink.v1.LogSummary.
inline constexpr const char* kSummaryName = "taclink.summary";
inline constexpr const char* kSummaryType = "application/x-protobuf; messageType=taclink.v1.LogSummary";
inline constexpr const char* kSolvedName =
    "taclink.solved";  ///< of a log that was solved again: from what, how
/// What a link was solved with; OptionsText.
std::string LinkMetadataName(std::string_view link);
inline constexpr const char* kConfigAttachment = "taclinkd.yaml";
inline constexpr const char* kUrdfAttachment = "arm.urdf";
std::string ModelAttachment(std::string_view link);
std::string CalibrationAttachment(std::string_view link);
/// taclink.v1.Acceptance as JSON: the link's last finished one when the recording began.
std::string AcceptanceAttachment(std::string_view link);

}  // namespace taclink::wire::log
