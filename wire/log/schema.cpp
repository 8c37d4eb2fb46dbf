#include "wire/log/schema.h"

#include <google/protobuf/descriptor.pb.h>

#include <set>

namespace taclink::wire::log {
namespace {

using google::protobuf::FileDescriptor;

// Imported files come before those that import them.
void AddFile(const FileDescriptor& file, std::set<const FileDescriptor*>& added,
             google::protobuf::FileDescriptorSet& out) {
  if (!added.insert(&file).second) return;
  for (int i = 0; i < file.dependency_count(); ++i) AddFile(*file.dependency(i), added, out);
  file.CopyTo(out.add_file());
}

}  // namespace

mcap::Schema ProtobufSchema(const google::protobuf::Descriptor& type) {
  google::protobuf::FileDescriptorSet files;
  std::set<const FileDescriptor*> added;
  AddFile(*type.file(), added, files);
  return {.name = type.full_name(), .encoding = "protobuf", .data = files.SerializeAsString()};
}

}  // namespace taclink::wire::log
