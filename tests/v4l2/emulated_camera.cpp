#include "tests/v4l2/emulated_camera.h"

#include <poll.h>
#include <sys/eventfd.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <cstring>
#include <ctime>

#include "tests/v4l2/uvc_descriptors.h"

namespace taclink::testing {
namespace {

constexpr uint8_t kControlInterface = 0, kVideoInterface = 1;
// Of the payload header, UVC 1.0, 2.4.3.3.
constexpr uint8_t kHeaderSize = 2, kEndOfPicture = 0x02, kErrorBit = 0x40, kEndOfHeader = 0x80;
// Places in the probe and commit controls, UVC 1.0, table 4-47.
constexpr size_t kFormatAt = 2, kSizeAt = 3, kIntervalAt = 4, kPictureBytesAt = 18, kPayloadBytesAt = 22;
constexpr uint8_t kSetCurrent = 0x01, kGetLength = 0x85, kGetInfo = 0x86;
constexpr uint8_t kCommit = 2;

int64_t NowNs() {
  timespec now{};
  clock_gettime(CLOCK_MONOTONIC, &now);
  return int64_t{now.tv_sec} * 1'000'000'000 + now.tv_nsec;
}

uint32_t Get32(std::span<const uint8_t> bytes) {
  return bytes[0] | uint32_t{bytes[1]} << 8 | uint32_t{bytes[2]} << 16 | uint32_t{bytes[3]} << 24;
}

void Put32(uint32_t value, std::span<uint8_t> to) {
  for (size_t i = 0; i < 4; ++i) to[i] = static_cast<uint8_t>(value >> (8 * i));
}

}  // namespace

EmulatedCamera::EmulatedCamera(std::string serial, PictureAt picture_at)
    : serial_(std::move(serial)), picture_at_(std::move(picture_at)), wake_(eventfd(0, EFD_CLOEXEC)) {
  SettleProbe();
  thread_ = std::jthread([this](const std::stop_token& stop) { Run(stop); });
}

EmulatedCamera::~EmulatedCamera() {
  thread_.request_stop();
  Wake();
  thread_.join();
  close(wake_);
}

std::string EmulatedCamera::Plug(int port) {
  std::string trouble;
  Do([this, port, &trouble] {
    Lost();
    settings_ = {};
    trouble = port_.Plug(port);
  });
  return trouble;
}

void EmulatedCamera::Unplug() {
  Do([this] { Lost(); });
}

void EmulatedCamera::Stall(bool stalled) {
  Do([this, stalled] { stalled_ = stalled; });
}

void EmulatedCamera::Spoil(Damage damage, int pictures) {
  Do([this, damage, pictures] {
    damage_ = damage;
    damaged_left_ = pictures;
  });
}

UvcSettings EmulatedCamera::settings() {
  UvcSettings out;
  Do([this, &out] { out = settings_; });
  return out;
}

uint64_t EmulatedCamera::pictures_sent() const {
  const std::lock_guard lock(mutex_);
  return pictures_sent_;
}

void EmulatedCamera::Wake() const {
  const uint64_t one = 1;
  [[maybe_unused]] const ssize_t written = write(wake_, &one, sizeof one);
}

/// On the thread, and waits for it.
void EmulatedCamera::Do(const std::function<void()>& command) {
  std::unique_lock lock(mutex_);
  commands_.push_back(command);
  const uint64_t mine = ++commands_given_;
  Wake();
  done_.wait(lock, [&] { return commands_done_ >= mine; });
}

void EmulatedCamera::Run(const std::stop_token& stop) {
  while (!stop.stop_requested()) {
    std::array<pollfd, 2> fds{pollfd{wake_, POLLIN, 0}, pollfd{port_.fd(), POLLIN, 0}};
    const int64_t left_ns = UntilNextNs();
    const timespec left{left_ns / 1'000'000'000, left_ns % 1'000'000'000};
    ppoll(fds.data(), fds.size(), &left, nullptr);
    if (fds[0].revents != 0) {
      uint64_t count = 0;
      [[maybe_unused]] const ssize_t got = read(wake_, &count, sizeof count);
      const std::lock_guard lock(mutex_);
      for (const auto& command : commands_) command();
      commands_done_ += commands_.size();
      commands_.clear();
      done_.notify_all();
      continue;  // the port may be another one now
    }
    if (fds[1].revents != 0) Serve();
    if (streaming_.on && !stalled_ && NowNs() >= streaming_.next_ns) Expose();
    if (!SendParts()) Lost();
  }
}

int64_t EmulatedCamera::UntilNextNs() const {
  constexpr int64_t kIdleNs = 100'000'000;
  if (!streaming_.on || stalled_) return kIdleNs;
  return std::clamp<int64_t>(streaming_.next_ns - NowNs(), 0, kIdleNs);
}

void EmulatedCamera::Lost() {
  port_.Unplug();
  streaming_.on = false;
  sending_ = false;
  waiting_.clear();
}

void EmulatedCamera::Serve() {
  auto request = port_.Receive();
  if (!request) return Lost();
  bool well = true;
  if (request->unlink) {
    const auto at = std::ranges::find(waiting_, request->id, &UsbRequest::id);
    const bool found = at != waiting_.end();
    if (found) waiting_.erase(at);
    well = port_.AnswerUnlink(*request, found);
  } else if (request->endpoint == 0) {
    well = HandleControl(*request);
  } else {
    waiting_.push_back(std::move(*request));
  }
  if (!well) Lost();
}

bool EmulatedCamera::HandleControl(const UsbRequest& request) {
  const uint8_t type = request.setup[0];
  const bool of_class = (type & 0x60) == 0x20;
  return of_class ? HandleVideo(request) : HandleStandard(request);
}

bool EmulatedCamera::HandleStandard(const UsbRequest& request) {
  enum : uint8_t { kGetStatus = 0, kClearFeature = 1, kGetDescriptor = 6, kSetConfiguration = 9 };
  enum : uint8_t { kGetInterface = 10, kSetInterface = 11 };
  const uint8_t index = request.setup[2];
  std::vector<uint8_t> answer;
  switch (request.setup[1]) {
    case kGetDescriptor:
      if (request.setup[3] == 1) answer = DeviceDescriptor();
      if (request.setup[3] == 2) answer = ConfigurationDescriptor();
      if (request.setup[3] == 3) answer = StringDescriptor(index, serial_);
      if (answer.empty()) return port_.Answer(request, -EPIPE, {});
      break;
    case kGetStatus:
      answer = {0, 0};
      break;
    case kGetInterface:
      answer = {0};
      break;
    case kClearFeature:  // so the driver ends a stream
      streaming_.on = sending_ = false;
      break;
    case kSetConfiguration:
    case kSetInterface:
      break;
    default:
      return port_.Answer(request, -EPIPE, {});
  }
  answer.resize(std::min<size_t>(answer.size(), request.length));
  return port_.Answer(request, 0, answer);
}

/// Probe and commit: what is to be streamed.
bool EmulatedCamera::HandleVideo(const UsbRequest& request) {
  const uint8_t code = request.setup[1], control = request.setup[3], interface = request.setup[4];
  if (interface == kControlInterface) return HandleSetting(request);
  if (interface != kVideoInterface) return port_.Answer(request, -EPIPE, {});
  if (code == kSetCurrent) {
    std::copy_n(request.data.begin(), std::min(request.data.size(), probe_.size()), probe_.begin());
    SettleProbe();
    if (control == kCommit) StartStreaming();
    return port_.Answer(request, 0, {}, request.length);
  }
  std::vector<uint8_t> answer(probe_.begin(), probe_.end());
  if (code == kGetLength) answer = {static_cast<uint8_t>(probe_.size()), 0};
  if (code == kGetInfo) answer = {3};
  answer.resize(std::min<size_t>(answer.size(), request.length));
  return port_.Answer(request, 0, answer);
}

bool EmulatedCamera::HandleSetting(const UsbRequest& request) {
  const UvcControl control{request.setup[1], request.setup[3], request.setup[5]};
  if (control.code == kSetCurrent) {
    const bool taken = WriteControl(control, request.data, settings_);
    return port_.Answer(request, taken ? 0 : -EPIPE, {}, taken ? request.length : 0);
  }
  auto answer = ReadControl(settings_, control);
  if (!answer) return port_.Answer(request, -EPIPE, {});
  answer->resize(std::min<size_t>(answer->size(), request.length));
  return port_.Answer(request, 0, *answer);
}

/// Makes what was asked for possible, as a camera does.
void EmulatedCamera::SettleProbe() {
  if (probe_[kFormatAt] != kUvcYuyv) probe_[kFormatAt] = kUvcMjpeg;
  if (probe_[kSizeAt] < 1 || probe_[kSizeAt] > kUvcSizes.size()) probe_[kSizeAt] = 1;
  const UvcSize& size = kUvcSizes[probe_[kSizeAt] - 1u];
  const uint32_t asked = Get32(std::span(probe_).subspan(kIntervalAt, 4));
  const bool offered =
      std::ranges::any_of(size.rates_hz, [&](int rate) { return UvcInterval100ns(rate) == asked; });
  if (!offered) Put32(UvcInterval100ns(size.rates_hz.front()), std::span(probe_).subspan(kIntervalAt, 4));
  Put32(UvcPictureBytes(size), std::span(probe_).subspan(kPictureBytesAt, 4));
  Put32(kUvcMaxPayload, std::span(probe_).subspan(kPayloadBytesAt, 4));
}

void EmulatedCamera::StartStreaming() {
  streaming_.on = true;
  streaming_.format = probe_[kFormatAt];
  streaming_.size = probe_[kSizeAt];
  streaming_.interval_100ns = Get32(std::span(probe_).subspan(kIntervalAt, 4));
  const int64_t interval_ns = int64_t{streaming_.interval_100ns} * 100;
  streaming_.next_ns = (NowNs() / interval_ns + 1) * interval_ns;
  sending_ = false;
}

void EmulatedCamera::Expose() {
  const int64_t interval_ns = int64_t{streaming_.interval_100ns} * 100;
  const int64_t exposure_ns = NowNs() / interval_ns * interval_ns;
  streaming_.next_ns = exposure_ns + interval_ns;
  if (sending_) return;  // the driver is too slow: this one is lost in the camera
  const std::span<const uint8_t> source = picture_at_(exposure_ns, streaming_.format);
  picture_.assign(source.begin(), source.end());
  with_error_bit_ = false;
  if (damaged_left_ > 0) {
    --damaged_left_;
    with_error_bit_ = damage_ == Damage::kErrorBit;
    if (damage_ == Damage::kShort) picture_.resize(picture_.size() / 2);
    if (damage_ == Damage::kCorrupt) {
      const auto at = static_cast<std::ptrdiff_t>(picture_.size() / 4);
      std::fill(picture_.begin() + at, picture_.begin() + 2 * at, uint8_t{0xff});
    }
  }
  sent_ = 0;
  sending_ = true;
  frame_bit_ ^= 1;
  const std::lock_guard lock(mutex_);
  ++pictures_sent_;
}

/// As many parts of the picture as the driver has room for.
bool EmulatedCamera::SendParts() {
  std::vector<uint8_t> part;
  while (sending_ && !waiting_.empty()) {
    const UsbRequest request = std::move(waiting_.front());
    waiting_.pop_front();
    const size_t room = std::min<size_t>(request.length, kUvcMaxPayload) - kHeaderSize;
    const size_t size = std::min(room, picture_.size() - sent_);
    const bool last = sent_ + size == picture_.size();
    part.assign({kHeaderSize, static_cast<uint8_t>(kEndOfHeader | frame_bit_ | (last ? kEndOfPicture : 0) |
                                                   (with_error_bit_ ? kErrorBit : 0))});
    const auto from = picture_.begin() + static_cast<std::ptrdiff_t>(sent_);
    part.insert(part.end(), from, from + static_cast<std::ptrdiff_t>(size));
    sent_ += size;
    sending_ = !last;
    if (!port_.Answer(request, 0, part)) return false;
  }
  return true;
}

}  // namespace taclink::testing
