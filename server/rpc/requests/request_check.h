#pragma once

#include <google/protobuf/message.h>
#include <grpcpp/impl/codegen/proto_utils.h>
#include <grpcpp/support/byte_buffer.h>

#include <string>

#include "sensing/core/result.h"

namespace taclink::server {

/// What every request must be before anything looks at it, field by field, by reflection, so that a new field
/// is checked too: numbers finite and within their bounds, enumerators known, lists of names without doubles,
/// texts short and without control characters. What depends on the arm's state is for the calls themselves.
/// Errors: kInvalidArgument, with the field's name first.
Result<void> CheckRequest(const google::protobuf::Message& request);

/// The request of a call that gRPC hands over as bytes, checked. Errors: kInvalidArgument.
template <typename Request>
Result<Request> ParseRequest(const grpc::ByteBuffer& bytes) {
  Request request;
  grpc::ByteBuffer copy(bytes);  // parsing empties it
  if (!grpc::SerializationTraits<Request>::Deserialize(&copy, &request).ok())
    return Error{ErrorCode::kInvalidArgument,
                 "the request is no " + Request::descriptor()->name() + " message"};
  if (const auto good = CheckRequest(request); !good) return good.error();
  return request;
}

/// The response of a call whose response gRPC takes as bytes.
template <typename Response>
grpc::ByteBuffer ToBytes(const Response& response) {
  grpc::ByteBuffer bytes;
  bool owned = false;
  // Fails only for messages of more than 2 GB.
  static_cast<void>(grpc::SerializationTraits<Response>::Serialize(response, &bytes, &owned));
  return bytes;
}

}  // namespace taclink::server
