#pragma once

#include <google/protobuf/descriptor.h>
#include <google/protobuf/descriptor_database.h>
#include <google/protobuf/dynamic_message.h>

#include <memory>
#include <string>

#include "mcap/records.h"
#include "sensing/core/result.h"

namespace taclink::command {

/// Messages of one type as JSON, by the schema record of a log alone: any type that a log describes.
class ProtobufJson {
 public:
  /// Errors: kUnsupported (no protobuf schema), kInvalidArgument (it is damaged, or its own type is not in
  /// it).
  static Result<std::unique_ptr<ProtobufJson>> Create(const mcap::Schema& schema);

  struct Text {
    std::string json;
    uint64_t left_out_bytes = 0;  ///< of a picture
  };
  /// With the fields' own names, and those of simple types even where they have their default. A picture's
  /// bytes (foxglove.CompressedImage, RawImage) only `with_pictures`. Errors: kInvalidArgument (not of this
  /// type).
  Result<Text> ToJson(mcap::Bytes data, bool with_pictures);

 private:
  ProtobufJson() : pool_(&files_, &errors_) {}

  struct Errors : google::protobuf::DescriptorPool::ErrorCollector {
    void AddError(const std::string& file, const std::string& element,
                  const google::protobuf::Message* descriptor, ErrorLocation location,
                  const std::string& message) override;
    std::string first;
  };

  google::protobuf::SimpleDescriptorDatabase files_;
  Errors errors_;
  google::protobuf::DescriptorPool pool_;
  google::protobuf::DynamicMessageFactory factory_;
  std::unique_ptr<google::protobuf::Message> message_;
  const google::protobuf::FieldDescriptor* picture_bytes_ = nullptr;  // none: not a picture
};

}  // namespace taclink::command
