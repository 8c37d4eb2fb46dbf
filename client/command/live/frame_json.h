#pragma once

#include <google/protobuf/repeated_field.h>

#include <string>

#include "client/command/cli/json.h"
#include "taclink/v1/frame.pb.h"

namespace taclink::command {

Json ToJson(const v1::Vector3& vector, double scale = 1);

/// Standard deviations of the three components; null: not known.
Json SigmasJson(const google::protobuf::RepeatedField<double>& covariance, double scale);

/// One line; contacts and arrays with the same keys and units (mm, N) as `taclink solve --json`.
std::string FrameJson(const v1::LinkFrame& frame);

}  // namespace taclink::command
