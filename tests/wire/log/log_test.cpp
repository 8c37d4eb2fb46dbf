#include <gmock/gmock.h>
#include <google/protobuf/descriptor.pb.h>
#include <google/protobuf/dynamic_message.h>
#include <gtest/gtest.h>

#include "foxglove/image.pb.h"
#include "foxglove/scene.pb.h"
#include "mcap/cursor.h"
#include "mcap/reader.h"
#include "sensing/model/model_file.h"
#include "taclink/v1/frame.pb.h"
#include "wire/log/log_writer.h"
#include "wire/log/picture.h"
#include "wire/log/scene.h"
#include "wire/log/schema.h"
#include "wire/log/times.h"
#include "wire/log/topics.h"

namespace taclink::wire::log {
namespace {

constexpr int64_t kUtcNs = 1'700'000'000'123'456'789;

TEST(Topics, ComeBackFromTheirText) {
  const Topic topics[] = {{.kind = TopicKind::kFrame, .link = "upper"},
                          {.kind = TopicKind::kScene, .link = "a/b/frame"},
                          {.kind = TopicKind::kPicture, .link = "upper", .camera = CameraId::kTop},
                          {.kind = TopicKind::kPicture, .link = "x", .camera = CameraId::kBottom},
                          {.kind = TopicKind::kArm},
                          {.kind = TopicKind::kContacts},
                          {.kind = TopicKind::kEvents},
                          {.kind = TopicKind::kJoints},
                          {.kind = TopicKind::kLosses},
                          {.kind = TopicKind::kTransforms}};
  for (const Topic& topic : topics) EXPECT_EQ(ParseTopic(ToText(topic)), topic) << ToText(topic);
  for (const char* other :
       {"", "/", "/links/", "/links//frame", "/links/frame", "/tf", "/arm/", "links/a/frame"})
    EXPECT_EQ(ParseTopic(other), std::nullopt) << other;
}

// A reader that knows nothing but the schema record can parse the message.
TEST(Schema, IsEnoughToParseAMessage) {
  const mcap::Schema schema = ProtobufSchema(*v1::LinkFrame::descriptor());
  EXPECT_EQ(schema.encoding, "protobuf");
  google::protobuf::FileDescriptorSet files;
  ASSERT_TRUE(files.ParseFromString(schema.data));
  google::protobuf::DescriptorPool pool;
  for (const auto& file : files.file()) ASSERT_NE(pool.BuildFile(file), nullptr) << file.name();
  const auto* type = pool.FindMessageTypeByName(schema.name);
  ASSERT_NE(type, nullptr);
  v1::LinkFrame frame;
  frame.set_link("upper");
  frame.add_contacts()->set_id(7);
  google::protobuf::DynamicMessageFactory factory;
  const std::unique_ptr<google::protobuf::Message> parsed(factory.GetPrototype(type)->New());
  ASSERT_TRUE(parsed->ParseFromString(frame.SerializeAsString()));
  EXPECT_EQ(parsed->DebugString(), frame.DebugString());
}

RawImage Picture(PixelFormat format) {
  RawImage image{.format = format, .width_px = 4, .height_px = 3, .bytes = {}};
  image.bytes.resize(format == PixelFormat::kMjpeg ? 1000 : format == PixelFormat::kYuyv ? 24 : 12);
  for (size_t i = 0; i < image.bytes.size(); ++i) image.bytes[i] = static_cast<uint8_t>(7 * i);
  image.valid = true;
  return image;
}

TEST(Pictures, ComeBackAsTheyWere) {
  for (const PixelFormat format : {PixelFormat::kYuyv, PixelFormat::kGray8, PixelFormat::kMjpeg}) {
    const RawImage image = Picture(format);
    const EncodedPicture encoded = EncodePicture(image, "link/a/top", kUtcNs);
    const auto decoded = DecodePicture(encoded.type->full_name(), *encoded.bytes);
    ASSERT_TRUE(decoded.ok()) << decoded.error().message;
    EXPECT_EQ(decoded->format, image.format);
    EXPECT_EQ(decoded->bytes, image.bytes);
    EXPECT_TRUE(decoded->valid);
    if (format == PixelFormat::kMjpeg) continue;
    EXPECT_EQ(decoded->width_px, image.width_px);
    EXPECT_EQ(decoded->height_px, image.height_px);
  }
}

// What Foxglove reads of it.
TEST(Pictures, AreFoxglovesMessages) {
  foxglove::RawImage raw;
  ASSERT_TRUE(raw.ParseFromString(*EncodePicture(Picture(PixelFormat::kYuyv), "link/a/top", kUtcNs).bytes));
  EXPECT_EQ(raw.encoding(), "yuyv");
  EXPECT_EQ(raw.step(), 8u);
  EXPECT_EQ(raw.data().size(), 24u);
  EXPECT_EQ(raw.frame_id(), "link/a/top");
  EXPECT_EQ(raw.timestamp().seconds() * 1'000'000'000 + raw.timestamp().nanos(), kUtcNs);
  foxglove::CompressedImage jpeg;
  ASSERT_TRUE(jpeg.ParseFromString(*EncodePicture(Picture(PixelFormat::kMjpeg), "link/a/top", kUtcNs).bytes));
  EXPECT_EQ(jpeg.format(), "jpeg");
  EXPECT_EQ(jpeg.data().size(), 1000u);
}

TEST(Pictures, OfOtherKindsAreRefused) {
  EXPECT_EQ(DecodePicture("foxglove.SceneUpdate", "").error().code, ErrorCode::kInvalidArgument);
  foxglove::RawImage colour;
  colour.set_encoding("rgb8");
  EXPECT_EQ(DecodePicture("foxglove.RawImage", colour.SerializeAsString()).error().code,
            ErrorCode::kUnsupported);
}

TEST(Scene, HasTheSkinAndAnArrowForEachContact) {
  const auto model = LoadLinkModel("cylinder");
  ASSERT_TRUE(model.ok());
  LinkState state;
  state.shape.positions_mm = model->RestMarkers();
  state.forces.forces_n.assign(state.shape.positions_mm.size(), Vec3::Zero());
  state.forces.forces_n[5] = Vec3(-0.2, 0, 0);
  Contact contact;
  contact.center_mm = Vec3(30, 0, 100);
  contact.normal = Vec3(1, 0, 0);
  contact.force_n = Vec3(-0.4, 0, 0);
  state.contacts.push_back(contact);
  foxglove::SceneUpdate scene;
  Fill("upper", model->markers, state, kUtcNs, scene);
  ASSERT_EQ(scene.entities_size(), 2);
  const auto& skin = scene.entities(0).triangles(0);
  EXPECT_EQ(skin.points_size(), model->markers.count());
  EXPECT_EQ(skin.colors_size(), skin.points_size());
  EXPECT_EQ(skin.indices_size(), 6 * model->markers.paths * (model->markers.rings() - 1));
  EXPECT_LT(*std::max_element(skin.indices().begin(), skin.indices().end()),
            static_cast<uint32_t>(skin.points_size()));
  EXPECT_GT(skin.colors(5).r(), skin.colors(4).r());
  // The arrow's head is on the skin.
  const auto& arrow = scene.entities(1).arrows(0);
  EXPECT_NEAR(arrow.shaft_length() + arrow.head_length(), 0.4 * kArrowMetresPerNewton, 1e-12);
  EXPECT_NEAR(arrow.pose().position().x(), 0.030 + 0.4 * kArrowMetresPerNewton, 1e-12);
  EXPECT_NEAR(arrow.pose().orientation().w(), 0, 1e-9);  // turned from +x to -x

  state.ClearMeasurement();
  Fill("upper", model->markers, state, kUtcNs, scene);
  EXPECT_EQ(scene.entities_size(), 0);
  EXPECT_EQ(scene.deletions(0).type(), foxglove::SceneEntityDeletion::ALL);
}

TEST(LogWriter, GivesEachTopicAndTypeAChannel) {
  mcap::BufferSink sink;
  auto writer = LogWriter::Create(sink, {});
  ASSERT_TRUE(writer.ok());
  v1::LinkFrame frame;
  const Topic upper{.kind = TopicKind::kFrame, .link = "upper"},
      camera{.kind = TopicKind::kPicture, .link = "upper"};
  for (uint64_t i = 1; i <= 3; ++i) {
    frame.set_sequence(i);
    ASSERT_TRUE(
        (*writer)->Write(upper, frame, {.log_utc_ns = kUtcNs + static_cast<int64_t>(i), .sequence = i}).ok());
  }
  for (const PixelFormat format : {PixelFormat::kYuyv, PixelFormat::kMjpeg}) {
    const EncodedPicture picture = EncodePicture(Picture(format), "f", kUtcNs);
    ASSERT_TRUE((*writer)->Write(camera, *picture.type, picture.bytes, {.log_utc_ns = kUtcNs}).ok());
  }
  ASSERT_TRUE((*writer)->mcap().Close().ok());
  const auto reader = mcap::Reader::Open(std::make_shared<mcap::MemorySource>(sink.bytes()));
  ASSERT_TRUE(reader.ok()) << reader.error().message;
  EXPECT_EQ((*reader)->schemas().size(), 3u);
  ASSERT_EQ((*reader)->channels().size(), 3u);
  EXPECT_EQ((*reader)->channels().begin()->second.metadata.at("link"), "upper");
  mcap::MessageCursor cursor(**reader, {});
  uint64_t frames = 0;
  while (const auto message = cursor.Next()) {
    if ((*reader)->channels().at(message->channel_id).topic != ToText(upper)) continue;
    ASSERT_TRUE(frame.ParseFromArray(message->data.data(), static_cast<int>(message->data.size())));
    EXPECT_EQ(frame.sequence(), ++frames);
    EXPECT_EQ(message->sequence, frames);
    EXPECT_EQ(message->log_time_ns, static_cast<uint64_t>(kUtcNs) + frames);
  }
  EXPECT_EQ(frames, 3u);
}

}  // namespace
}  // namespace taclink::wire::log
