#pragma once

#include <google/protobuf/descriptor.h>

#include "mcap/records.h"

namespace taclink::wire::log {

/// The schema record of a message type: encoding "protobuf", data a FileDescriptorSet of its file and all
/// that it imports.
mcap::Schema ProtobufSchema(const google::protobuf::Descriptor& type);

}  // namespace taclink::wire::log
