#include "bench/log/log_load.h"

#include <fcntl.h>
#include <unistd.h>

#include <algorithm>
#include <chrono>
#include <cstring>
#include <filesystem>
#include <fstream>
#include <random>
#include <thread>

#include "bench/server/server_process.h"
#include "bench/vision/vision_score.h"
#include "client/cpp/taclink/recordings.h"
#include "mcap/cursor.h"
#include "mcap/file_sink.h"
#include "mcap/reader.h"
#include "mcap/writer.h"
#include "sensing/capture/image_io.h"
#include "sensing/core/link_state.h"
#include "sensing/model/model_file.h"
#include "wire/frame_codec.h"
#include "wire/log/picture.h"
#include "wire/log/topics.h"

namespace taclink::command {
namespace {

using std::chrono::steady_clock;

constexpr int kLinks = 6;
constexpr double kRateHz = 30;
constexpr uint64_t kStartNs = 1'700'000'000'000'000'000;
constexpr uint64_t kChunkBytes = uint64_t{4} << 20;
constexpr int kSeeks = 200;
constexpr double kReadMegabytes = 1000;

double SecondsSince(steady_clock::time_point begin) {
  return std::chrono::duration<double>(steady_clock::now() - begin).count();
}

size_t Bytes(const LogContent& content, size_t messages) {
  size_t bytes = 0;
  for (size_t i = 0; i < messages; ++i) bytes += content.messages[i % content.messages.size()]->size();
  return bytes;
}

Result<uint16_t> AddChannel(const LogContent& content, mcap::Writer& writer) {
  const auto schema = writer.AddSchema({.name = content.type, .encoding = "protobuf"});
  if (!schema) return schema.error();
  return writer.AddChannel({.schema_id = *schema, .topic = content.topic, .message_encoding = "protobuf"});
}

mcap::Message MessageOf(const LogContent& content, uint16_t channel, uint64_t number) {
  const auto time_ns = kStartNs + static_cast<uint64_t>(1e9 * static_cast<double>(number) / content.rate_hz);
  return {.channel_id = channel,
          .sequence = static_cast<uint32_t>(number),
          .log_time_ns = time_ns,
          .publish_time_ns = time_ns,
          .data = mcap::AsBytes(*content.messages[number % content.messages.size()])};
}

Result<void> WriteLog(const LogContent& content, mcap::Compression compression, const std::string& path,
                      size_t messages) {
  auto sink = mcap::FileSink::Create(path);
  if (!sink) return sink.error();
  auto writer = mcap::Writer::Create(**sink, {.compression = compression, .chunk_bytes = kChunkBytes});
  if (!writer) return writer.error();
  const auto channel = AddChannel(content, **writer);
  if (!channel) return channel.error();
  for (uint64_t i = 0; i < messages; ++i) {
    const auto written =
        (*writer)->Write(MessageOf(content, *channel, i), content.messages[i % content.messages.size()]);
    if (!written) return written.error();
  }
  if (const auto closed = (*writer)->Close(); !closed) return closed.error();
  return (*sink)->Sync();
}

// The same messages, one after another.
Result<void> WritePlain(const LogContent& content, const std::string& path, size_t messages) {
  const int file = ::open(path.c_str(), O_WRONLY | O_CREAT | O_EXCL | O_CLOEXEC, 0600);
  bool good = file >= 0;
  std::string pending;
  const auto flush = [&] {
    size_t done = 0;
    while (good && done < pending.size()) {
      const ssize_t n = ::write(file, pending.data() + done, pending.size() - done);
      good = n > 0;
      done += good ? static_cast<size_t>(n) : 0;
    }
    pending.clear();
  };
  for (size_t i = 0; good && i < messages; ++i) {
    const std::string& message = *content.messages[i % content.messages.size()];
    if (message.size() < kChunkBytes / 16) {  // small ones are collected, as anybody would
      pending += message;
      if (pending.size() >= kChunkBytes) flush();
      continue;
    }
    good = ::write(file, message.data(), message.size()) == static_cast<ssize_t>(message.size());
  }
  flush();
  good = good && ::fdatasync(file) == 0;
  if (file >= 0) ::close(file);
  if (!good) return Error{ErrorCode::kUnavailable, path + ": " + std::strerror(errno)};
  return {};
}

double Median(std::vector<double> values) {
  std::sort(values.begin(), values.end());
  return values[values.size() / 2];
}

}  // namespace

LogContent MakeFrameContent() {
  LogContent content{.name = "frames",
                     .topic = wire::log::ToText({.kind = wire::log::TopicKind::kFrame, .link = "link"}),
                     .rate_hz = kLinks * kRateHz,
                     .type = "taclink.v1.LinkFrame"};
  const auto model = LoadLinkModel("cylinder");
  std::mt19937 random(1);
  std::normal_distribution<double> noise(0, 0.02);
  for (uint64_t i = 0; i < 64; ++i) {
    LinkState state;
    state.sequence = i;
    state.status = LinkStatus::kOk;
    state.shape.positions_mm = model->RestMarkers();
    const size_t markers = state.shape.positions_mm.size();
    for (Vec3& p : state.shape.positions_mm) {
      const Vec3 moved(noise(random), noise(random), noise(random));
      p += moved;
      state.shape.displacements_mm.push_back(moved);
      state.shape.covariances_mm2.emplace_back(1e-4 * Mat3::Identity());
    }
    state.shape.sources.assign(markers, MarkerSource::kBoth);
    state.forces.forces_n.assign(markers, Vec3::Zero());
    state.forces.sigmas_n.assign(markers, 0);
    content.messages.push_back(
        std::make_shared<const std::string>(wire::EncodeFrame({"link", 0}, state, Detail::kFull)));
  }
  return content;
}

Result<LogContent> MakePictureContent(const LoadPictures& pictures) {
  LogContent content{.name = "YUYV pictures",
                     .topic = wire::log::ToText({.kind = wire::log::TopicKind::kPicture, .link = "link"}),
                     .rate_hz = 2 * kLinks * kRateHz,
                     .type = "foxglove.RawImage"};
  for (const auto& file : std::filesystem::directory_iterator(pictures.folder)) {
    if (file.path().extension() != ".png") continue;
    RawImage image;
    if (const auto read = ReadRawImage(file.path().string(), image); !read) return read.error();
    std::vector<uint8_t> yuyv;
    for (const uint8_t gray : image.bytes) yuyv.insert(yuyv.end(), {gray, uint8_t{128}});
    image.bytes = std::move(yuyv);
    image.format = PixelFormat::kYuyv;
    content.messages.push_back(wire::log::EncodePicture(image, "link/link/top", kStartNs).bytes);
  }
  return content;
}

Result<WriteResult> MeasureWriting(const LogContent& content, mcap::Compression compression,
                                   const std::string& folder, double megabytes, int rounds) {
  const auto messages = std::max<size_t>(
      1, static_cast<size_t>(megabytes * 1e6 / static_cast<double>(Bytes(content, content.messages.size())) *
                             static_cast<double>(content.messages.size())));
  const double bytes = static_cast<double>(Bytes(content, messages));
  WriteResult result{.content = content.name, .compression = compression};
  std::vector<double> log_s, plain_s, ratios;
  const std::string path = folder + "/write";
  double cpu_s = 0;
  for (int round = 0; round < rounds; ++round) {
    const double cpu_before = OwnUsage().cpu_s;
    auto begin = steady_clock::now();
    if (const auto written = WriteLog(content, compression, path, messages); !written) return written.error();
    log_s.push_back(SecondsSince(begin));
    cpu_s += OwnUsage().cpu_s - cpu_before;
    result.size = static_cast<double>(std::filesystem::file_size(path)) / bytes;
    std::filesystem::remove(path);
    begin = steady_clock::now();
    if (const auto written = WritePlain(content, path, messages); !written) return written.error();
    plain_s.push_back(SecondsSince(begin));
    std::filesystem::remove(path);
    ratios.push_back(plain_s.back() / log_s.back());
  }
  result.log_mb_s = bytes * 1e-6 / Median(log_s);
  result.plain_mb_s = bytes * 1e-6 / Median(plain_s);
  result.ratio = Median(ratios);
  result.cpu_us = cpu_s * 1e6 / static_cast<double>(messages) / rounds;
  return result;
}

namespace {

// All contents as they would come in a recording.
Result<void> WriteMixed(const std::vector<LogContent>& contents, const std::string& path, double bytes) {
  auto sink = mcap::FileSink::Create(path);
  if (!sink) return sink.error();
  auto writer = mcap::Writer::Create(**sink, {.chunk_bytes = kChunkBytes});
  if (!writer) return writer.error();
  std::vector<uint16_t> channels;
  for (const LogContent& content : contents) {
    const auto channel = AddChannel(content, **writer);
    if (!channel) return channel.error();
    channels.push_back(*channel);
  }
  std::vector<uint64_t> next(contents.size(), 0);
  while (static_cast<double>((*sink)->position()) < bytes) {
    size_t first = 0;
    const auto due = [&](size_t i) { return static_cast<double>(next[i]) / contents[i].rate_hz; };
    for (size_t i = 1; i < contents.size(); ++i) {
      if (due(i) < due(first)) first = i;
    }
    const uint64_t number = next[first]++;
    const auto written = (*writer)->Write(MessageOf(contents[first], channels[first], number),
                                          contents[first].messages[number % contents[first].messages.size()]);
    if (!written) return written.error();
  }
  return (*writer)->Close();
}

}  // namespace

Result<ReadResult> MeasureReading(const std::vector<LogContent>& contents, const std::string& folder,
                                  double gigabytes) {
  const std::string path = folder + "/read.mcap";
  if (const auto written = WriteMixed(contents, path, gigabytes * 1e9); !written) return written.error();
  ReadResult result;
  result.gigabytes = static_cast<double>(std::filesystem::file_size(path)) * 1e-9;
  auto begin = steady_clock::now();
  auto source = mcap::FileSource::Open(path);
  if (!source) return source.error();
  const auto reader = mcap::Reader::Open(std::shared_ptr<const mcap::ByteSource>(std::move(*source)));
  if (!reader) return reader.error();
  result.open_ms = 1e3 * SecondsSince(begin);
  const mcap::Statistics& statistics = (*reader)->statistics();
  result.messages = statistics.message_count;
  const uint64_t length_ns = statistics.message_end_ns - statistics.message_start_ns;
  result.hours = static_cast<double>(length_ns) / 3600e9;
  std::mt19937_64 random(1);
  std::vector<float> seeks_ms;
  for (int i = 0; i < kSeeks; ++i) {
    const uint64_t time_ns = statistics.message_start_ns + random() % std::max<uint64_t>(length_ns, 1);
    begin = steady_clock::now();
    mcap::MessageCursor cursor(**reader, {.start_ns = time_ns});
    if (const auto message = cursor.Next(); !message) return message.error();
    seeks_ms.push_back(static_cast<float>(1e3 * SecondsSince(begin)));
  }
  result.seek_p50_ms = Percentile(seeks_ms, 0.5);
  result.seek_p99_ms = Percentile(seeks_ms, 0.99);
  double bytes = 0;
  begin = steady_clock::now();
  mcap::MessageCursor cursor(**reader, {});
  while (bytes < kReadMegabytes * 1e6) {
    const auto message = cursor.Next();
    if (!message && message.error().code == ErrorCode::kEndOfData) break;
    if (!message) return message.error();
    bytes += static_cast<double>(message->data.size());
  }
  result.read_mb_s = bytes * 1e-6 / SecondsSince(begin);
  std::filesystem::remove(path);
  return result;
}

Result<std::vector<RecordResult>> MeasureRecording(const LoadPictures& pictures, const std::string& taclinkd,
                                                   const std::string& folder, double seconds) {
  const std::string config = folder + "/record.yaml";
  std::ofstream(config) << LoadConfigText(pictures, kLinks, kRateHz, true) << "recording: {folder: \""
                        << folder << "/logs\", split_mb: 0}\n";
  const auto server = ServerProcess::Start(taclinkd, config, folder + "/record.log");
  if (!server) return server.error();
  auto connection = client::Client::Connect((*server)->address(), client::Patience(std::chrono::seconds(10)));
  if (!connection) return connection.error();
  if (const auto ready = WaitUntilMeasuring(*connection); !ready) return ready.error();
  const auto pause = [&] { std::this_thread::sleep_for(std::chrono::duration<double>(seconds)); };
  const double before_s = (*server)->Usage().cpu_s;
  pause();
  const double without_cores = ((*server)->Usage().cpu_s - before_s) / seconds;
  client::Recordings recordings = connection->RecordingCalls();
  std::vector<RecordResult> results;
  for (const bool with_pictures : {false, true}) {
    RecordResult result{.what = with_pictures ? "frames and YUYV pictures" : "frames, zstd",
                        .without_cores = without_cores};
    const auto skipped = FramesSkipped(*connection);
    const double cpu_s = (*server)->Usage().cpu_s;
    const auto begin = steady_clock::now();
    v1::StartRecordingRequest request;
    request.set_pictures(with_pictures);
    if (const auto started = recordings.Start(request); !started) return started.error();
    pause();
    const auto status = recordings.Stop();
    if (!status) return status.error();
    result.seconds = SecondsSince(begin);
    result.server_cores = ((*server)->Usage().cpu_s - cpu_s) / result.seconds;
    const auto skipped_after = FramesSkipped(*connection);
    if (!skipped || !skipped_after) return skipped ? skipped_after.error() : skipped.error();
    result.frames = status->frames();
    result.lost = status->frames_lost();
    result.skipped = *skipped_after - *skipped;
    result.mb_s = static_cast<double>(status->bytes()) * 1e-6 / result.seconds;
    if (const auto removed = recordings.Delete(status->log()); !removed) return removed.error();
    results.push_back(result);
  }
  return results;
}

}  // namespace taclink::command
