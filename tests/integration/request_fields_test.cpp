// Every field of every request: what it must not be is refused by its name, and changes nothing. By
// reflection over the API, so that a new call and a new field are tried too.
#include <gmock/gmock.h>
#include <grpcpp/generic/generic_stub.h>
#include <grpcpp/grpcpp.h>
#include <gtest/gtest.h>

#include <filesystem>
#include <limits>
#include <set>

#include "taclink/v1/acceptance.grpc.pb.h"
#include "taclink/v1/operations.grpc.pb.h"
#include "taclink/v1/pressure.grpc.pb.h"
#include "taclink/v1/recording.grpc.pb.h"
#include "taclink/v1/simulation.grpc.pb.h"
#include "taclink/v1/tactile.grpc.pb.h"
#include "tests/integration/support.h"

namespace taclink::server {
namespace {

using google::protobuf::Descriptor;
using google::protobuf::FieldDescriptor;
using google::protobuf::Message;
using google::protobuf::MethodDescriptor;
using google::protobuf::Reflection;
using ::testing::HasSubstr;

// Where a negative or a huge number is a right one, and why.
const std::set<std::string> kMayBeNegative = {
    "UpdateJointStatesRequest.positions",
    "UpdateJointStatesRequest.velocities",
    "UpdatePressureRequest.pressure_pa",  // below the surroundings
    "TrialReference.pressure_pa",         // likewise
    "Vector3.x",
    "Vector3.y",
    "Vector3.z",
    "PressRequest.angle_rad",
    "MoveSceneJointRequest.position_rad",
    "SetCameraRequest.gain",  // in units of the camera, which knows its range
};
const std::set<std::string> kMayBeHuge = {
    "SetCameraRequest.gain",
    "PressRequest.body_id",  // chosen by the caller
    "ReleaseRequest.body_id",
    "DownloadLogRequest.offset",           // past a log's end is OUT_OF_RANGE
    "StreamEventsRequest.after_sequence",  // has not happened, or belongs to another run
    "ReplayRequest.from_utc_ns",
    "ReplayRequest.to_utc_ns",  // past a log's end
    "ControlReplayRequest.seek_utc_ns",
    "GetReplayPicturesRequest.utc_ns",
    "UpdateJointStatesRequest.utc_ns",
    "UpdateJointStatesRequest.monotonic_ns",  // far from the server's clock
    "UpdatePressureRequest.utc_ns",
    "UpdatePressureRequest.monotonic_ns",
    "UpdateAttitudeRequest.utc_ns",
    "UpdateAttitudeRequest.monotonic_ns",
};

struct BadValue {
  std::string field;  // MESSAGE.FIELD
  std::string what;
  std::unique_ptr<Message> request;
};

/// Requests of one type, each with one field that it must not have.
class BadRequests {
 public:
  explicit BadRequests(const Message& base) : base_(base) { Visit(*base.GetDescriptor(), {}); }
  std::vector<BadValue>& values() { return values_; }

 private:
  using Path = std::vector<const FieldDescriptor*>;  // of the messages around

  void Visit(const Descriptor& type, const Path& path) {
    for (int i = 0; i < type.field_count(); ++i) {
      const FieldDescriptor& field = *type.field(i);
      if (field.cpp_type() == FieldDescriptor::CPPTYPE_MESSAGE) {
        ASSERT_FALSE(field.is_repeated()) << field.full_name() << ": teach this test lists of messages";
        Path deeper = path;
        deeper.push_back(&field);
        Visit(*field.message_type(), deeper);
      } else {
        VisitValue(field, path);
      }
    }
  }

  void VisitValue(const FieldDescriptor& field, const Path& path) {
    const std::string name = field.containing_type()->name() + "." + field.name();
    const bool negative = !kMayBeNegative.contains(name), huge = !kMayBeHuge.contains(name);
    switch (field.cpp_type()) {
      case FieldDescriptor::CPPTYPE_DOUBLE: {
        using Limits = std::numeric_limits<double>;
        for (const double bad : {Limits::quiet_NaN(), Limits::infinity(), -Limits::infinity()})
          Add(field, path, std::to_string(bad), &Reflection::SetDouble, &Reflection::AddDouble, bad);
        if (negative) Add(field, path, "-1", &Reflection::SetDouble, &Reflection::AddDouble, -1.0);
        if (huge) Add(field, path, "1e300", &Reflection::SetDouble, &Reflection::AddDouble, 1e300);
        break;
      }
      case FieldDescriptor::CPPTYPE_INT32:
        AddWhole<int32_t>(field, path, negative, huge, &Reflection::SetInt32, &Reflection::AddInt32);
        break;
      case FieldDescriptor::CPPTYPE_INT64:
        AddWhole<int64_t>(field, path, negative, huge, &Reflection::SetInt64, &Reflection::AddInt64);
        break;
      case FieldDescriptor::CPPTYPE_UINT32:
        AddWhole<uint32_t>(field, path, false, huge, &Reflection::SetUInt32, &Reflection::AddUInt32);
        break;
      case FieldDescriptor::CPPTYPE_UINT64:
        AddWhole<uint64_t>(field, path, false, huge, &Reflection::SetUInt64, &Reflection::AddUInt64);
        break;
      case FieldDescriptor::CPPTYPE_ENUM:
        Add(field, path, "unknown", &Reflection::SetEnumValue, &Reflection::AddEnumValue, 9999);
        AddDoubled(field, path, &Reflection::AddEnumValue, 1);
        break;
      case FieldDescriptor::CPPTYPE_STRING:
        for (const std::string& bad :
             {std::string("up\x1b[2Jper"), std::string("up\0per", 6), std::string("\x7f"),
              std::string("\xc2\x9b"), std::string(100'000 / 20, 'x')})
          Add<std::string>(field, path, "text of " + std::to_string(bad.size()), &Reflection::SetString,
                           &Reflection::AddString, bad);
        AddDoubled<std::string>(field, path, &Reflection::AddString, "upper");
        break;
      case FieldDescriptor::CPPTYPE_BOOL:
        break;
      default:
        FAIL() << field.full_name() << ": teach this test " << field.cpp_type_name();
    }
  }

  template <typename T>
  using Set = void (Reflection::*)(Message*, const FieldDescriptor*, T) const;

  Message& In(BadValue& value, const Path& path) const {
    Message* message = value.request.get();
    for (const FieldDescriptor* field : path)
      message = message->GetReflection()->MutableMessage(message, field);
    return *message;
  }
  BadValue& New(const FieldDescriptor& field, const std::string& what) {
    BadValue value{.field = field.containing_type()->name() + "." + field.name(),
                   .what = what,
                   .request = std::unique_ptr<Message>(base_.New())};
    value.request->CopyFrom(base_);
    return values_.emplace_back(std::move(value));
  }
  template <typename T>
  void Add(const FieldDescriptor& field, const Path& path, const std::string& what, Set<T> set, Set<T> add,
           T bad) {
    Message& message = In(New(field, what), path);
    const Reflection& reflection = *message.GetReflection();
    field.is_repeated() ? (reflection.*add)(&message, &field, bad) : (reflection.*set)(&message, &field, bad);
  }
  template <typename T>
  void AddWhole(const FieldDescriptor& field, const Path& path, bool negative, bool huge, Set<T> set,
                Set<T> add) {
    const T most = std::numeric_limits<T>::max();
    if (negative) Add(field, path, "-1", set, add, static_cast<T>(-1));
    if (huge) Add(field, path, std::to_string(most), set, add, most);
  }
  template <typename T>
  void AddDoubled(const FieldDescriptor& field, const Path& path, Set<T> add, T value) {
    if (!field.is_repeated()) return;
    Message& message = In(New(field, "doubled"), path);
    message.GetReflection()->ClearField(&message, &field);
    for (int i = 0; i < 2; ++i) (message.GetReflection()->*add)(&message, &field, value);
  }

  const Message& base_;
  std::vector<BadValue> values_;
};

/// Any call with one message from the client; what the server answers is read and forgotten.
grpc::Status Call(grpc::GenericStub& stub, const MethodDescriptor& method, const std::string& request) {
  grpc::ClientContext context;
  context.set_deadline(std::chrono::system_clock::now() + kForever);
  grpc::CompletionQueue queue;
  const auto wait = [&queue] {
    void* tag = nullptr;
    bool ok = false;
    EXPECT_TRUE(queue.Next(&tag, &ok));
    return ok;
  };
  const auto call =
      stub.PrepareCall(&context, "/" + method.service()->full_name() + "/" + method.name(), &queue);
  call->StartCall(nullptr);
  if (wait()) {
    const grpc::Slice slice(request);
    call->WriteLast(grpc::ByteBuffer(&slice, 1), {}, nullptr);
    wait();
    grpc::ByteBuffer answer;
    call->Read(&answer, nullptr);
    if (wait()) context.TryCancel();  // it was accepted
  }
  grpc::Status status;
  call->Finish(&status, nullptr);
  wait();
  queue.Shutdown();
  return status;
}

class RequestFieldsTest : public ::testing::Test {
 protected:
  static std::vector<const MethodDescriptor*> Methods() {
    std::vector<const MethodDescriptor*> out;
    for (const auto* service :
         {v1::GetArmRequest::descriptor()->file()->FindServiceByName("TactileService"),
          v1::StartRecordingRequest::descriptor()->file()->FindServiceByName("RecordingService"),
          v1::RestartLinkRequest::descriptor()->file()->FindServiceByName("OperationsService"),
          v1::SetPressureRequest::descriptor()->file()->FindServiceByName("PressureService"),
          v1::PressRequest::descriptor()->file()->FindServiceByName("SimulationService"),
          v1::MeasureTrialRequest::descriptor()->file()->FindServiceByName("AcceptanceService")}) {
      EXPECT_NE(service, nullptr);
      for (int i = 0; service != nullptr && i < service->method_count(); ++i)
        out.push_back(service->method(i));
    }
    return out;
  }
  static std::unique_ptr<Message> BaseOf(const MethodDescriptor& method) {
    std::unique_ptr<Message> base(
        google::protobuf::MessageFactory::generated_factory()->GetPrototype(method.input_type())->New());
    if (const auto* link = method.input_type()->FindFieldByName("link"))
      base->GetReflection()->SetString(base.get(), link, "upper");
    return base;
  }
  // All that a call may change, as clients see it.
  std::string State() {
    v1::GetArmResponse arm;
    grpc::ClientContext context;
    EXPECT_TRUE(tactile_->GetArm(&context, {}, &arm).ok());
    v1::RecorderStatus recorder = server_.recorder().Status();
    recorder.clear_free_bytes();
    return arm.ShortDebugString() + recorder.ShortDebugString() +
           std::to_string(server_.arm().events().history().newest()) + " streams " +
           std::to_string(server_.server().streams());
  }

  const std::string folder_ = NewFolder("request_fields");
  TestServer server_{TestLimits(), nullptr, {}, {.folder = folder_}};
  const std::shared_ptr<grpc::Channel> channel_ =
      grpc::CreateChannel(server_.server().address(), grpc::InsecureChannelCredentials());
  const std::unique_ptr<v1::TactileService::Stub> tactile_ = v1::TactileService::NewStub(channel_);
  grpc::GenericStub stub_{channel_};
};

TEST_F(RequestFieldsTest, WhatTheyMustNotBeIsRefusedByNameAndChangesNothing) {
  const std::string before = State();
  size_t tried = 0;
  for (const MethodDescriptor* method : Methods()) {
    const std::unique_ptr<Message> base = BaseOf(*method);
    BadRequests bad(*base);
    for (const BadValue& value : bad.values()) {
      SCOPED_TRACE(method->name() + ": " + value.field + " = " + value.what);
      const grpc::Status status = Call(stub_, *method, value.request->SerializePartialAsString());
      EXPECT_EQ(status.error_code(), grpc::StatusCode::INVALID_ARGUMENT) << status.error_message();
      EXPECT_THAT(status.error_message(), HasSubstr(value.field.substr(value.field.find('.') + 1)));
      EXPECT_LT(status.error_message().size(), 400u);
      ++tried;
    }
  }
  EXPECT_GT(tried, 150u);
  EXPECT_TRUE(State() == before) << State();
  EXPECT_FALSE(std::filesystem::exists(folder_));
}

TEST_F(RequestFieldsTest, BytesThatAreNoMessageAreRefusedAndChangeNothing) {
  const std::string before = State();
  for (const MethodDescriptor* method : Methods()) {
    SCOPED_TRACE(method->name());
    // A length-delimited field that is longer than the message, and a field number that is none.
    for (const std::string& bytes : {std::string("\x0a\x7fup"), std::string("\x00\x00", 2)}) {
      const grpc::Status status = Call(stub_, *method, bytes);
      EXPECT_FALSE(status.ok());
      EXPECT_NE(status.error_code(), grpc::StatusCode::CANCELLED) << "it was accepted";
      if (method->client_streaming()) {
        EXPECT_EQ(status.error_code(), grpc::StatusCode::INVALID_ARGUMENT);
        EXPECT_THAT(status.error_message(), ::testing::HasSubstr(method->input_type()->name()));
      }
    }
  }
  EXPECT_EQ(State(), before);
}

}  // namespace
}  // namespace taclink::server
