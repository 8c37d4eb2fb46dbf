// Health and reflection, as any gRPC tool asks for them. Debian has no generated code for them, so by hand.
#include <gmock/gmock.h>
#include <grpcpp/create_channel.h>
#include <grpcpp/generic/generic_stub.h>
#include <gtest/gtest.h>

#include <memory>
#include <string>
#include <thread>
#include <vector>

#include "tests/integration/support.h"

namespace taclink::server {
namespace {

using ::testing::HasSubstr;

grpc::ByteBuffer ToBuffer(const std::string& text) {
  const grpc::Slice slice(text);
  return {&slice, 1};
}

std::string ToText(const grpc::ByteBuffer& buffer) {
  std::vector<grpc::Slice> slices;
  std::string text;
  if (!buffer.Dump(&slices).ok()) return text;
  for (const auto& slice : slices) text.append(reinterpret_cast<const char*>(slice.begin()), slice.size());
  return text;
}

struct Reply {
  grpc::Status status;
  std::string text;
};

// Sends one message to a method, unary or streaming, and takes the first one that comes back.
Reply Ask(const std::string& address, const std::string& method, const std::string& request) {
  const auto channel = grpc::CreateChannel(address, grpc::InsecureChannelCredentials());
  grpc::GenericStub stub(channel);
  grpc::ClientContext context;
  context.set_deadline(std::chrono::system_clock::now() + kForever);
  grpc::CompletionQueue queue;
  void* tag = nullptr;
  bool ok = false;
  const auto call = stub.PrepareCall(&context, method, &queue);
  call->StartCall(nullptr);
  queue.Next(&tag, &ok);
  call->WriteLast(ToBuffer(request), {}, nullptr);
  queue.Next(&tag, &ok);
  grpc::ByteBuffer response;
  call->Read(&response, nullptr);
  queue.Next(&tag, &ok);
  Reply reply;
  if (ok) reply.text = ToText(response);
  call->Finish(&reply.status, nullptr);
  queue.Next(&tag, &ok);
  return reply;
}

constexpr const char* kHealthCheck = "/grpc.health.v1.Health/Check";
constexpr const char* kHealthWatch = "/grpc.health.v1.Health/Watch";
constexpr const char* kReflection = "/grpc.reflection.v1alpha.ServerReflection/ServerReflectionInfo";

std::string HealthRequest(const std::string& service) {
  return service.empty() ? "" : std::string("\x0a") + static_cast<char>(service.size()) + service;
}

TEST(StandardServices, HealthIsServingForEachService) {
  TestServer server;
  const std::string serving("\x08\x01", 2);
  for (const char* service : {"", "taclink.v1.TactileService", "taclink.v1.OperationsService"}) {
    const Reply reply = Ask(server.server().address(), kHealthCheck, HealthRequest(service));
    EXPECT_TRUE(reply.status.ok()) << reply.status.error_message();
    EXPECT_EQ(reply.text, serving);
  }
  EXPECT_EQ(Ask(server.server().address(), kHealthCheck, HealthRequest("no.Such")).status.error_code(),
            grpc::StatusCode::NOT_FOUND);
}

// A Watch call that is under way.
class HealthWatch {
 public:
  HealthWatch(const std::shared_ptr<grpc::Channel>& channel, const std::string& service) : stub_(channel) {
    context_.set_deadline(std::chrono::system_clock::now() + kForever);
    call_ = stub_.PrepareCall(&context_, kHealthWatch, &queue_);
    call_->StartCall(nullptr);
    Await();
    call_->WriteLast(ToBuffer(HealthRequest(service)), {}, nullptr);
    Await();
  }
  // Empty: the call has ended.
  std::string Next() {
    grpc::ByteBuffer response;
    call_->Read(&response, nullptr);
    return Await() ? ToText(response) : "";
  }
  grpc::Status End() {
    grpc::Status status;
    call_->Finish(&status, nullptr);
    Await();
    return status;
  }
  void Cancel() { context_.TryCancel(); }

 private:
  bool Await() {
    void* tag = nullptr;
    bool ok = false;
    return queue_.Next(&tag, &ok) && ok;
  }

  grpc::GenericStub stub_;
  grpc::ClientContext context_;
  grpc::CompletionQueue queue_;
  std::unique_ptr<grpc::GenericClientAsyncReaderWriter> call_;
};

TEST(StandardServices, HealthIsWatchedUntilTheServerEnds) {
  TestServer server;
  const auto channel = grpc::CreateChannel(server.server().address(), grpc::InsecureChannelCredentials());
  HealthWatch known(channel, "taclink.v1.TactileService"), unknown(channel, "no.Such");
  EXPECT_EQ(known.Next(), std::string("\x08\x01", 2)) << "SERVING";
  EXPECT_EQ(unknown.Next(), std::string("\x08\x03", 2)) << "SERVICE_UNKNOWN";
  std::thread stop([&] { server.Stop(); });
  EXPECT_EQ(known.Next(), std::string("\x08\x02", 2)) << "NOT_SERVING";
  EXPECT_EQ(known.Next(), "");
  EXPECT_EQ(known.End().error_code(), grpc::StatusCode::UNAVAILABLE);
  unknown.Next();
  unknown.End();
  stop.join();
}

// Health asks for no token, so whoever can connect can open such streams.
TEST(StandardServices, HealthWatchesAreBoundedAndTakeNoStreams) {
  TestServer server;
  const auto channel = grpc::CreateChannel(server.server().address(), grpc::InsecureChannelCredentials());
  std::vector<std::unique_ptr<HealthWatch>> watches;
  for (int i = 0; i < 8; ++i) {
    watches.push_back(std::make_unique<HealthWatch>(channel, ""));
    EXPECT_NE(watches.back()->Next(), "");
  }
  HealthWatch another(channel, "");
  EXPECT_EQ(another.Next(), "");
  const grpc::Status refused = another.End();
  EXPECT_EQ(refused.error_code(), grpc::StatusCode::RESOURCE_EXHAUSTED);
  EXPECT_THAT(refused.error_message(), HasSubstr("8 watches of health"));
  EXPECT_EQ(server.server().streams(), 0U);
  for (const auto& each : watches) {
    each->Cancel();
    EXPECT_EQ(each->Next(), "");
    each->End();
  }
}

TEST(StandardServices, ReflectionListsTheServices) {
  TestServer server;
  const std::string list_services("\x3a\x00", 2);
  const Reply reply = Ask(server.server().address(), kReflection, list_services);
  EXPECT_TRUE(reply.status.ok()) << reply.status.error_message();
  EXPECT_THAT(reply.text, HasSubstr("taclink.v1.TactileService"));
}

TEST(StandardServices, BytesThatAreNoRequestAreRefused) {
  TestServer server;
  const Reply reply =
      Ask(server.server().address(), "/taclink.v1.TactileService/StreamFrames", std::string("\x0a\xff", 2));
  EXPECT_EQ(reply.status.error_code(), grpc::StatusCode::INVALID_ARGUMENT);
}

}  // namespace
}  // namespace taclink::server
