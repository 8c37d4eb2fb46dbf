#include "client/command/cli/protobuf_json.h"

#include <google/protobuf/descriptor.pb.h>
#include <google/protobuf/util/json_util.h>

namespace taclink::command {
namespace {

using google::protobuf::FieldDescriptor;

bool IsPicture(const std::string& type) {
  return type == "foxglove.CompressedImage" || type == "foxglove.RawImage";
}

}  // namespace

void ProtobufJson::Errors::AddError(const std::string& file, const std::string& element,
                                    const google::protobuf::Message* /*descriptor*/,
                                    ErrorLocation /*location*/, const std::string& message) {
  if (first.empty()) first = file + ": " + element + ": " + message;
}

Result<std::unique_ptr<ProtobufJson>> ProtobufJson::Create(const mcap::Schema& schema) {
  if (schema.encoding != "protobuf")
    return Error{ErrorCode::kUnsupported,
                 "schema " + schema.name + " is of encoding '" + schema.encoding + "'"};
  google::protobuf::FileDescriptorSet files;
  if (!files.ParseFromString(schema.data))
    return Error{ErrorCode::kInvalidArgument, "schema " + schema.name + " is no FileDescriptorSet"};
  std::unique_ptr<ProtobufJson> out(new ProtobufJson());
  for (const auto& file : files.file()) out->files_.Add(file);
  const auto* type = out->pool_.FindMessageTypeByName(schema.name);
  if (type == nullptr) {
    const std::string& why = out->errors_.first;
    return Error{ErrorCode::kInvalidArgument,
                 "schema " + schema.name + " does not describe this type" + (why.empty() ? "" : ": " + why)};
  }
  out->message_.reset(out->factory_.GetPrototype(type)->New());
  const FieldDescriptor* data = IsPicture(schema.name) ? type->FindFieldByName("data") : nullptr;
  if (data != nullptr && data->type() == FieldDescriptor::TYPE_BYTES && !data->is_repeated())
    out->picture_bytes_ = data;
  return out;
}

Result<ProtobufJson::Text> ProtobufJson::ToJson(mcap::Bytes data, bool with_pictures) {
  if (!message_->ParseFromArray(data.data(), static_cast<int>(data.size())))
    return Error{ErrorCode::kInvalidArgument, "no " + message_->GetDescriptor()->full_name()};
  Text text;
  if (picture_bytes_ != nullptr && !with_pictures) {
    const auto& reflection = *message_->GetReflection();
    text.left_out_bytes = reflection.GetString(*message_, picture_bytes_).size();
    reflection.ClearField(message_.get(), picture_bytes_);
  }
  google::protobuf::util::JsonPrintOptions options;
  options.preserve_proto_field_names = true;
  options.always_print_primitive_fields = true;
  const auto status = google::protobuf::util::MessageToJsonString(*message_, &text.json, options);
  if (!status.ok())
    return Error{ErrorCode::kInvalidArgument,
                 message_->GetDescriptor()->full_name() + ": " + std::string(status.message())};
  return text;
}

}  // namespace taclink::command
