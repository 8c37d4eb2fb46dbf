// taclink_print_messages ADDRESS EVENTS: a frame and events as the C++ client has them, one JSON object a
// line.
#include <google/protobuf/util/json_util.h>
#include <taclink/client.h>

#include <cstdio>
#include <cstdlib>
#include <cstring>
#include <stdexcept>
#include <string>

namespace {

using namespace taclink;

constexpr std::chrono::seconds kPatience{30};

void Print(const google::protobuf::Message& message) {
  google::protobuf::util::JsonPrintOptions options;
  options.preserve_proto_field_names = true;
  options.always_print_primitive_fields = true;
  std::string text;
  if (!google::protobuf::util::MessageToJsonString(message, &text, options).ok())
    throw std::runtime_error("a message is not JSON");
  std::printf("%s\n", text.c_str());
}

template <typename T>
T Must(Result<T> result) {
  if (!result) throw std::runtime_error(result.error().message);
  return *std::move(result);
}

void Run(const std::string& address, int events) {
  auto client = Must(client::Client::Connect(address));
  v1::StreamFramesRequest frames;
  frames.set_detail(v1::DETAIL_FULL);
  Print(Must(Must(client.StreamFrames(frames))->Next(kPatience)));
  const auto reader = Must(client.StreamEvents({}));
  for (int i = 0; i < events; ++i) {
    const v1::Event event = Must(reader->Next(kPatience));
    if (std::strcmp(client::Name(event.kind()), "unknown") == 0)
      throw std::runtime_error("event kind " + std::to_string(event.kind()) + " has no name");
    Print(event);
  }
}

}  // namespace

int main(int argc, char** argv) {
  try {
    Run(argc > 1 ? argv[1] : "", argc > 2 ? std::atoi(argv[2]) : 0);
  } catch (const std::exception& e) {
    std::fprintf(stderr, "%s\n", e.what());
    return 1;
  }
}
